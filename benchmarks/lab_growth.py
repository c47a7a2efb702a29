"""How time and memory of the lab grow with the rows of the logs: `python benchmarks/lab_growth.py [ROWS...]`.

Flights of 50 000 rows at 50 Hz are made by a model, prepared and diagnosed. What counts is the time per row beside that
of the smallest run: 1.0 where the time is linear. Every flight brings nuisances of its own, so that it grows faster
than the rows where there are very many flights.
"""

import resource
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from quadctl.effects.base import Conditions
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.data import load_dataset
from quadctl.lab.diagnose import diagnose
from quadctl.logs.columns import STATE_COLUMNS, rpm_columns
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle, load_vehicle

ROWS_PER_FLIGHT = 50_000
RATE_HZ = 50.0
SIZES = (50_000, 200_000)
CANDIDATES = (ConstantScale, Exponential, LinearDrag, AxialInflow)
RAPTOR = Path(__file__).parent.parent / "config/vehicles/raptor.yaml"
Row = tuple[str, str, str]


def rows(sizes: Sequence[int] = SIZES) -> Iterator[Row]:
    vehicle = load_vehicle(RAPTOR)
    first = None
    for size in sizes:
        logs = [made_up(vehicle, seed) for seed in range(max(1, size // ROWS_PER_FLIGHT))]
        begin = time.perf_counter()
        data = load_dataset(logs, vehicle)
        prepared = time.perf_counter()
        missing = diagnose(Model(vehicle), data, CANDIDATES).missing
        done = time.perf_counter()
        assert missing == ["ground_effect"], missing
        per_row = (done - begin) / size
        first = first or per_row
        yield (
            f"{size} rows prepared and diagnosed, {len(CANDIDATES)} candidates",
            f"{prepared - begin:.1f} + {done - prepared:.1f} s, {peak_mb():.0f} MB",
            f"{per_row / first:.2f} x the time per row of {sizes[0]} rows",
        )


def made_up(vehicle: Vehicle, seed: int) -> FlightLog:
    """A level flight over the heights, whose rotor speeds obey a ground effect; white noise on the velocity."""
    random = np.random.default_rng(seed)
    t = np.arange(ROWS_PER_FLIGHT) / RATE_HZ
    columns = {name: 1e-6 * random.standard_normal(len(t)) for name in STATE_COLUMNS}
    w, swell = 2.0 * np.pi * 0.25, 2.0 * np.pi * 0.02
    size, z = 0.45 * np.sin(swell * t) ** 2, 0.6
    z = z + size * np.sin(w * t)
    vz = np.gradient(z, t)
    force = vehicle.mass_kg * (np.gradient(vz, t) + GRAVITY_M_S2)
    level = (np.ones_like(t), 0.0 * t, 0.0 * t, 0.0 * t)
    c = Conditions(z + vehicle.rotor_height_m, (0.0 * t, 0.0 * t, -vz), level, t)
    each = force / Exponential(a=0.3, b=5.0).ratio(c, vehicle) / vehicle.n_rotors
    columns |= {"time_s": t, "z_m": z, "vz_m_s": vz + 0.01 * random.standard_normal(len(t))}
    columns |= {name: 0.01 * random.standard_normal(len(t)) for name in ("vx_m_s", "vy_m_s")}
    columns |= dict.fromkeys(rpm_columns(vehicle.n_rotors), np.sqrt(each / vehicle.rotor.thrust_n_per_rpm2))
    return FlightLog(name=f"made_{seed}.csv", path=None, columns=columns)


def peak_mb() -> float:
    """Of this process, since its start."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


if __name__ == "__main__":
    for line in rows([int(size) for size in sys.argv[1:]] or SIZES):
        Console(width=150).print(*line, sep=" | ", markup=False, highlight=False)
