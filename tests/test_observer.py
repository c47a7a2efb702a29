"""The observer of slow forces and moments: its filter, and its section of a model file."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from quadctl.effects.motor_lag import lagged as lagged_by_hats
from quadctl.errors import SettingsError
from quadctl.lab.rotation.innovations import Noise, rate_filter
from quadctl.model import Model, load_model, model_to_dict, save_model
from quadctl.observer import AXES, Observer, delayed, lagged, rolled_out, steady_filter
from quadctl.vehicle import Vehicle

OBSERVER = Observer(
    step_s=0.01,
    **{
        axis: {"quick": 1.0 + i, "quick_s": 0.03, "slow": 2.0 + i, "slow_s": 2.0 + 0.1 * i, "sensor": 0.01}
        | ({"share": 0.1 * i, "damping_1_s": 1.0 + i} if i > 2 else {})
        for i, axis in enumerate(AXES)
    },
)


class TestSteadyFilter:
    @pytest.mark.parametrize("quick_s", [0.007, 0.03, 0.3])
    @pytest.mark.parametrize("slow_s", [0.3, 3.0, 30.0])
    @pytest.mark.parametrize("slow", [1e-3, 0.3, 30.0])
    @pytest.mark.parametrize("sensor", [2e-5, 0.02, 50.0])
    def test_it_is_that_of_the_riccati_equation(
        self, quick_s: float, slow_s: float, slow: float, sensor: float
    ) -> None:
        """SciPy's solution, whose unit is the quick disturbance."""
        expected, size = rate_filter(Noise(quick_s, slow_s, slow, sensor), 0.0, 0.01), 7.0
        transition, gain = steady_filter(np.array([size, quick_s, size * slow, slow_s, size * sensor]), 0.01)
        assert transition == pytest.approx(expected.transition, abs=1e-12)
        assert transition @ gain == pytest.approx(expected.gain, rel=1e-7, abs=1e-9)

    @pytest.mark.parametrize("noise", [(1e-6, 1e-3, 1e6, 1e3, 1e-6), (1e6, 1e3, 1e-6, 1e-3, 1e-6), (1e-6,) * 5])
    def test_it_is_stable_for_all_that_a_file_may_hold(self, noise: tuple[float, ...]) -> None:
        transition, gain = steady_filter(np.maximum(noise, [0.0, 1e-3, 0.0, 1e-3, 0.0]), 0.1)
        closed = transition - np.outer(transition @ gain, [1.0, 0.0, 0.0])
        assert np.all(np.isfinite(gain)) and np.max(np.abs(np.linalg.eigvals(closed))) <= 1.0 + 1e-9


class TestRolledOut:
    def test_what_follows_and_fades_does_so_exactly_however_quick(self) -> None:
        """A lag far below the step, one like it and one far above, behind a body at rest."""
        lags_s = np.array([1e-3, 0.012, 0.4])
        u = np.cumsum(np.random.default_rng(4).standard_normal((3, 40)), axis=1)
        x = np.concatenate([np.zeros(6), [1.0, 0.0, 0.0, 0.0], np.zeros(3), u[:, 0]])
        ends = rolled_out(lambda x, u: np.concatenate([0.0 * x[:13], (u - x[13:]) / lags_s]), x, u, lags_s, 0.01)
        for i, lag_s in enumerate(lags_s):
            assert ends[13 + i] == pytest.approx(lagged(u[i : i + 1], lag_s, 0.01)[0])
            assert ends[13 + i] == pytest.approx(lagged_by_hats(u[i], 0.01, lag_s), abs=0.02)  # its memory ends


def test_commands_are_delayed_by_parts_of_a_step() -> None:
    u = np.array([[1.0, 2.0, 4.0, 4.0], [0.0, 1.0, 0.0, 0.0]])
    assert delayed(u, 0.015, 0.01) == pytest.approx(np.array([[1.0, 1.0, 1.5, 3.0], [0.0, 0.0, 0.5, 0.5]]))


class TestFile:
    def test_it_comes_back_with_the_model_and_models_without_it_are_as_before(
        self, raptor: Vehicle, tmp_path: Path
    ) -> None:
        save_model(replace(Model(raptor), observer=OBSERVER), tmp_path / "turning.yaml")
        assert load_model(tmp_path / "turning.yaml").observer == OBSERVER
        save_model(Model(raptor), tmp_path / "plain.yaml")
        assert load_model(tmp_path / "plain.yaml").observer is None
        assert "observer" not in (tmp_path / "plain.yaml").read_text()
        data = model_to_dict(replace(Model(raptor), observer=OBSERVER), None)
        del data["observer"]["yaw"]["share"], data["observer"]["yaw"]["damping_1_s"]
        (tmp_path / "before.yaml").write_text(yaml.safe_dump(data))
        before = load_model(tmp_path / "before.yaml").observer
        assert before is not None and before.trusted[2].tolist() == [1.0, 0.0]

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            (lambda o: o["roll"].update(slow_s=0.0), "observer.roll.slow_s is 0.0, expected greater than or equal"),
            (lambda o: o["roll"].update(share=3.0), "observer.roll.share is 3.0, expected less than or equal to 2"),
            (lambda o: o["down"].update(share=1.0), "unknown key 'observer.down.share'"),
            (lambda o: o["down"].update(sensor="much"), "observer.down.sensor is 'much', expected a number"),
            (lambda o: o["yaw"].update(slow=float("inf")), "observer.yaw.slow is inf, expected"),
            (lambda o: o.pop("east"), "observer.east is missing"),
            (lambda o: o.update(step_s=1.0), "observer.step_s is 1.0, expected less than or equal to 0.1"),
            (lambda o: o["north"].update(bias=1.0), "unknown key 'observer.north.bias'"),
        ],
    )
    def test_what_it_cannot_hold_is_one_sentence(
        self, change: Callable[[dict[str, object]], object], words: str, raptor: Vehicle, tmp_path: Path
    ) -> None:
        data = model_to_dict(replace(Model(raptor), observer=OBSERVER), None)
        change(data["observer"])
        (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(data))
        with pytest.raises(SettingsError) as refused:
            load_model(tmp_path / "wrong.yaml")
        assert words in str(refused.value) and "\n" not in str(refused.value)
