"""The watch over the model that flies: residual at every tick, changes that are told, quantities that are known."""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from quadctl.flight.model_watch.changes import Change, Changes
from quadctl.flight.model_watch.prediction import Prediction, Predictor, slopes
from quadctl.flight.model_watch.regression import Block, Blocks, Estimate, Recursion
from quadctl.frames import rotate_inverse
from quadctl.missions.mission import QUANTITIES
from quadctl.model import Model
from quadctl.state import NAN, NO_VECTOR, AttitudeTarget, Setpoint, Vec3, VehicleState
from quadctl.surfaces import Place

LEAST_BLOCKS = 30
"""Blocks before a quantity counts as known: until then it is not known how the vehicle follows its reference."""
FILTER_S = 0.3
"""Time constant of the filter of the residual."""
NORMAL_95 = 1.959964
"""Half of a 95 % interval over the standard deviation."""


class ModelError(NamedTuple):
    """Error of the model at one tick."""

    body_m_s2: Vec3 = NO_VECTOR
    """Filtered residual of the specific force, measured less predicted, FRD."""
    ned_m_s2: Vec3 = NO_VECTOR
    expected_m_s2: float = NAN
    """Half of the 95 % interval of one axis, by the residuals of the fit; nan for a model that was not fitted."""
    changes: tuple[Change, ...] = ()
    """Changes that are told at this time."""


NO_ERROR = ModelError()


class News(NamedTuple):
    """Changes that a tick is the first to tell, and names of those that are over."""

    begun: tuple[Change, ...] = ()
    over: tuple[str, ...] = ()


NO_NEWS = News()


class Known(NamedTuple):
    """A quantity as this flight knows it."""

    values: tuple[float, ...]
    """Thrust over the model's; drag forward and right, or inflow, 1/s."""
    share: float
    """Half of the 95 % interval over the value, the larger one of two; infinite in the first seconds."""

    def __str__(self) -> str:
        return f"{' and '.join(f'{value:.3g}' for value in self.values)}, to {self.share:.1%}"


UNKNOWN = Known((), math.inf)


class ModelWatch:
    """Watches one flight: call `look` at every tick in the air, `sent` with the target that goes out after it."""

    def __init__(self, model: Model, place: Place | None = None) -> None:
        self._predictor = Predictor(model, place)
        self._blocks = Blocks()
        self._now, self._whole = Recursion(constant=False), Recursion(constant=True)
        self._changes = Changes()
        self._model = model
        rmse = [item.fitted.rmse_after for item in model.stack if item.fitted and item.fitted.rmse_after is not None]
        self._expected_m_s2 = NORMAL_95 * rmse[-1] if rmse else NAN
        self._slow: tuple[Vec3, Vec3] | None = None
        """Velocity and predicted acceleration after the filter."""
        self._tasks: list[Callable[[], None]] = []
        """Tasks of the last block that are left: one a tick, so that no tick is late for them."""
        self._block: tuple[Block, float] | None = None
        """The last block, and the time of flight at which it began."""
        self._n_blocks = 0
        self._battery_v = NAN
        self.known = dict.fromkeys(QUANTITIES, UNKNOWN)
        """Quantities of a vehicle that has not changed in this flight."""
        self.error = NO_ERROR

    def sent(self, time_s: float, target: AttitudeTarget, reference: Setpoint) -> None:
        """Take in the target of a tick, and the reference that it follows."""
        self._predictor.sent(time_s, target, reference)

    def pause(self) -> None:
        """Forget the present state: the vehicle does not fly by our targets, or stands on the ground."""
        self._predictor.forget()
        self._blocks.forget()
        self._slow, self.error = None, NO_ERROR

    def look(self, state: VehicleState, ground_down_m: float, now_s: float) -> News:
        """Take in the state of one tick in the air, `now_s` after the first; return what is new of changes."""
        at = self._predictor.predict(state, ground_down_m)
        if at is None:
            return NO_NEWS
        if not all(map(math.isfinite, at.acceleration_ned)):  # an effect that has no value here, or no input yet
            self.pause()
            return NO_NEWS
        self._battery_v = state.battery_v
        ned = self._filtered(state.velocity_ned_m_s, at)
        x, y, z = rotate_inverse(state.attitude, ned)
        before = self.error.changes
        self.error = self.error._replace(body_m_s2=(x, y, z), ned_m_s2=ned, expected_m_s2=self._expected_m_s2)
        block = self._blocks.add(at, state.velocity_ned_m_s, state.attitude)
        if block is not None:
            self._block, self._n_blocks = (block, now_s - block.duration_s), self._n_blocks + 1
            self._tasks = [partial(self._whole.take, block), partial(self._now.take, block), self._judge]
        if self._tasks:
            self._tasks.pop(0)()
        known, told = {change.name for change in before}, {change.name for change in self.error.changes}
        begun = tuple(change for change in self.error.changes if change.name not in known)
        return News(begun, tuple(sorted(known - told)))

    def _filtered(self, velocity: Vec3, at: Prediction) -> Vec3:
        """Residual after a filter of first order, which differentiates the velocity at the same time."""
        share = at.dt / (at.dt + FILTER_S)
        (u, v, w), (a, b, c) = self._slow or (velocity, (0.0, 0.0, 0.0))
        (x, y, z), (n, e, d) = velocity, at.acceleration_ned
        u, v, w = u + share * (x - u), v + share * (y - v), w + share * (z - w)
        a, b, c = a + share * (n - a), b + share * (e - b), c + share * (d - c)
        self._slow = (u, v, w), (a, b, c)
        return (x - u) / FILTER_S - a, (y - v) / FILTER_S - b, (z - w) / FILTER_S - c

    def _judge(self) -> None:
        assert self._block is not None
        self.error = self.error._replace(changes=self._changes.judge(self._now.estimates(), *self._block))
        if self._n_blocks >= LEAST_BLOCKS:
            self.known = self._known()

    def _known(self) -> dict[str, Known]:
        found, modelled = self._whole.estimates(), slopes(self._model, self._battery_v)
        return {
            "thrust": Known((1.0 + found["thrust"].value,), _share(1.0, found["thrust"])),
            "drag": Known(
                (modelled.forward + found["drag forward"].value, modelled.right + found["drag right"].value),
                max(_share(modelled.forward, found["drag forward"]), _share(modelled.right, found["drag right"])),
            ),
            "inflow": Known((modelled.down + found["inflow"].value,), _share(modelled.down, found["inflow"])),
        }


def _share(known: float, change: Estimate) -> float:
    """Half of the 95 % interval of a parameter over its size, which is `known` plus a change."""
    size = abs(known + change.value)
    return NORMAL_95 * change.std / size if size > 0.0 else math.inf  # also of what is not known
