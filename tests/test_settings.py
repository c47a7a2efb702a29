"""Bad settings are refused in one sentence that names the file, the field, the value and what was expected."""

import copy
from pathlib import Path
from typing import Any

import pytest
import yaml

from quadctl.control import ControllerSettings
from quadctl.errors import SettingsError
from quadctl.model import load_model
from quadctl.settings import load, read_yaml, validate
from quadctl.vehicle import Vehicle, load_vehicle


@pytest.fixture
def vehicle_data(raptor_path: Path) -> dict[str, Any]:
    data: dict[str, Any] = yaml.safe_load(raptor_path.read_text())
    return data


def refusal(path: Path, kind: Any = Vehicle) -> str:
    """Error message about the file, without its name in front."""
    with pytest.raises(SettingsError) as caught:
        load(path, kind)
    return checked_sentence(str(caught.value), path)


def checked_sentence(sentence: str, path: Path) -> str:
    assert sentence.startswith(str(path)), "names the file"
    assert "\n" not in sentence, "is one sentence"
    return sentence.removeprefix(str(path))


def changed(data: dict[str, Any], where: str, value: Any) -> dict[str, Any]:
    """A copy of `data` with the value at `where` (keys and indices with dots between them) set."""
    data = copy.deepcopy(data)
    *way, last = [int(part) if part.isdigit() else part for part in where.split(".")]
    target: Any = data
    for part in way:
        target = target[part]
    target[last] = value
    return data


# --- files ---------------------------------------------------------------------------------------------------------


def test_missing_file(tmp_path: Path) -> None:
    assert refusal(tmp_path / "none.yaml") == ": there is no such file"


def test_directory(tmp_path: Path) -> None:
    assert refusal(tmp_path) == ": is a directory, expected a YAML file"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", ": is empty, expected settings in YAML"),
        (b"# only a remark\n", ": is empty, expected settings in YAML"),
        (b"\xff\xfe\x00", ": is not a text file, expected YAML"),
        (b"- 1\n- 2\n", ": holds [1, 2], expected a mapping of keys to values"),
        (b"hello", ": holds 'hello', expected a mapping of keys to values"),
        (b"name: [a, b", ", line 1, column 12: is not valid YAML: expected ',' or ']', but got '<stream end>'"),
        (b"rotor:\n\tradius_m: 1\n", ", line 2, column 1: is not valid YAML: found character"),
        (b"name: \x00", ": is not valid YAML: unacceptable character #x0000"),
        (b"name: a\nmass_kg: 1\nname: b\n", ", line 3, column 1: is not valid YAML: the key 'name' is given twice"),
        (b"rotor: {radius_m: 1, radius_m: 2}", "the key 'radius_m' is given twice"),
        (b"name: 2024-13-45\n", ": is not valid YAML: month must be in 1..12"),
        (b"1: raptor\n", ", line 1, column 1: is not valid YAML: this key is not text, put it in quotes"),
        (b"name: !!python/object:os.system {}", "could not determine a constructor for the tag"),
        (b"[" * 5000, ": is nested too deeply to be settings"),
    ],
)
def test_unusable_content(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "vehicle.yaml"
    path.write_bytes(content)
    assert said in refusal(path)


def test_a_number_may_be_written_without_a_point(tmp_path: Path) -> None:
    # YAML 1.1 takes 1e-7 for text; nobody who writes it means text.
    path = tmp_path / "numbers.yaml"
    path.write_text("a: 1e-7\nb: -2E3\nc: 1.5e3\nd: 1e\n")
    assert read_yaml(path) == {"a": 1e-7, "b": -2000.0, "c": 1500.0, "d": "1e"}


def test_merge_keys_work(tmp_path: Path) -> None:
    path = tmp_path / "merged.yaml"
    path.write_text("a: &base {p: 1, i: 2}\nb: {<<: *base, i: 3}\n")
    assert read_yaml(path)["b"] == {"p": 1, "i": 3}


# --- fields --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("where", "value", "said"),
    [
        ("mass_kg", -1.0, ": mass_kg is -1.0, expected greater than 0"),
        ("mass_kg", 0.0, ": mass_kg is 0.0, expected greater than 0"),
        ("mass_kg", float("nan"), ": mass_kg is nan, expected a finite number"),
        ("mass_kg", float("inf"), ": mass_kg is inf, expected a finite number"),
        ("mass_kg", "heavy", ": mass_kg is 'heavy', expected a number"),
        ("mass_kg", None, ": mass_kg is empty, expected a number"),
        ("mass_kg", [1, 2], ": mass_kg is [1, 2], expected a number"),
        ("name", 5, ": name is 5, expected text"),
        ("rotor", 5, ": rotor is 5, expected keys and values"),
        ("rotor.radius_m", -0.1, ": rotor.radius_m is -0.1, expected greater than 0"),
        ("rotors", 5, ": rotors is 5, expected a list"),
        ("rotors.1.spin", "left", ": rotors[2].spin is 'left', expected 'cw' or 'ccw'"),
        ("rotors.1.position_m", [1, 2], ": rotors[2].position_m[3] is missing"),
        ("rotors.1.position_m", [1, 2, 3, 4], "is [1, 2, 3, 4], expected at most 3 entries, not 4"),
        ("rotors.0.cant_deg", 90.0, ": rotors[1].cant_deg is 90.0, expected less than 90"),
        ("inertia_kg_m2", [0.01, 0.01, 0.0], ": inertia_kg_m2[3] is 0.0, expected greater than 0"),
        ("throttle.per_newton", 0, ": throttle.per_newton is 0, expected greater than 0"),
        # unknown keys, the nearest known one of the same level suggested
        ("mas_kg", 1.5, ": unknown key 'mas_kg' (did you mean 'mass_kg'?)"),
        ("Mass_kg", 1.5, ": unknown key 'Mass_kg' (did you mean 'mass_kg'?)"),
        ("rotor.radius", 0.1, ": unknown key 'rotor.radius' (did you mean 'radius_m'?)"),
        ("rotor.Radius_m", 0.1, ": unknown key 'rotor.Radius_m' (did you mean 'radius_m'?)"),
        ("rotors.2.spn", "cw", ": unknown key 'rotors[3].spn' (did you mean 'spin'?)"),
        ("throttle.zz", 1, ": unknown key 'throttle.zz', expected one of: max_thrust_per_rotor_n, offset, per_newton"),
    ],
)
def test_bad_field(tmp_path: Path, vehicle_data: dict[str, Any], where: str, value: Any, said: str) -> None:
    path = tmp_path / "vehicle.yaml"
    path.write_text(yaml.safe_dump(changed(vehicle_data, where, value)))
    assert said in refusal(path)


def test_missing_field(tmp_path: Path, vehicle_data: dict[str, Any]) -> None:
    del vehicle_data["rotor"]["radius_m"]
    path = tmp_path / "vehicle.yaml"
    path.write_text(yaml.safe_dump(vehicle_data))
    assert refusal(path) == ": rotor.radius_m is missing"


def test_a_misspelt_key_is_said_and_not_that_the_right_one_is_missing(
    tmp_path: Path, vehicle_data: dict[str, Any]
) -> None:
    vehicle_data["mas_kg"] = vehicle_data.pop("mass_kg")
    path = tmp_path / "vehicle.yaml"
    path.write_text(yaml.safe_dump(vehicle_data))
    assert refusal(path) == ": unknown key 'mas_kg' (did you mean 'mass_kg'?)"


def test_too_few_rotors(tmp_path: Path, vehicle_data: dict[str, Any]) -> None:
    vehicle_data["rotors"] = vehicle_data["rotors"][:2]
    path = tmp_path / "vehicle.yaml"
    path.write_text(yaml.safe_dump(vehicle_data))
    said = refusal(path)
    assert said.startswith(": rotors is [")
    assert said.endswith("expected at least 3 entries, not 2")
    assert len(said) < 150, "a long value is cut"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("min_throttle: 0.95", ": min_throttle is 0.95, expected less than max_throttle"),
        ("rate_hz: 5", ": rate_hz is 5, expected greater than or equal to 10"),
        ("velocity_vertical: {p: 4.0, i: 2.0}", ": velocity_vertical.d is missing"),
        (
            "velocity_vertical: {p: 4.0, i: 2.0, d: -1.0}",
            ": velocity_vertical.d is -1.0, expected greater than or equal",
        ),
        ("max_tilt: 30", ": unknown key 'max_tilt' (did you mean 'max_tilt_deg'?)"),
    ],
)
def test_bad_controller(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "controller.yaml"
    path.write_text(text)
    assert said in refusal(path, ControllerSettings)


def test_settings_cannot_change_and_a_changed_copy_computes_anew(raptor: Vehicle) -> None:
    with pytest.raises(ValueError, match="frozen"):
        raptor.mass_kg = 2.0
    assert raptor.weight_n == pytest.approx(1.5 * 9.80665)  # cached from here on
    assert raptor.model_copy(update={"mass_kg": 2.0}).weight_n == pytest.approx(2.0 * 9.80665)


def test_what_is_no_mapping_is_said_as_such() -> None:
    with pytest.raises(SettingsError, match=r"^vehicle: the file is 5, expected keys and values$"):
        validate(5, Vehicle, "vehicle")


# --- model files ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("effects: []", ": vehicle is missing"),
        ("vehicle: 5", ": vehicle is 5, expected text"),
        ("vehicle: {}", ": vehicle.name is missing"),
        ("vehicle: raptor.yaml\neffects:", ": effects is empty, expected a list"),
        ("vehicle: raptor.yaml\neffects: [cheeseman]", ": effects[1] is 'cheeseman', expected keys and values"),
        (
            "vehicle: raptor.yaml\neffects: [{efect: cheeseman}]",
            ": unknown key 'effects[1].efect' (did you mean 'effect'?)",
        ),
        (
            "vehicle: raptor.yaml\neffects: [{effect: cheeseman}, {effect: ground_effect.exponentail}]",
            ": effects[2]: there is no effect 'ground_effect.exponentail' (did you mean 'ground_effect.exponential'?)",
        ),
        (
            "vehicle: raptor.yaml\neffects: [{effect: rotor_darg}]",
            ": effects[1]: there is no effect 'rotor_darg' (did you mean 'rotor_drag'?)",
        ),
        (
            "vehicle: raptor.yaml\neffects: [{effect: qqqq}]",
            "there is no effect 'qqqq', expected one of: thrust_scale.",
        ),
        (
            "vehicle: raptor.yaml\neffects: [{effect: cheeseman, fitted: {height_m: [0.1]}}]",
            ": effects[1].fitted.height_m[2] is missing",
        ),
        (
            "vehicle: raptor.yaml\neffects: [{effect: cheeseman, fitted: {rmse_after: low}}]",
            ": effects[1].fitted.rmse_after is 'low', expected a number",
        ),
    ],
)
def test_bad_model(tmp_path: Path, raptor_path: Path, text: str, said: str) -> None:
    (tmp_path / "raptor.yaml").write_text(raptor_path.read_text())
    path = tmp_path / "model.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError) as caught:
        load_model(path)
    assert said in checked_sentence(str(caught.value), path)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ("{a: 9}", "parameter a of ground_effect.exponential is 9, expected a number from 0 to 5"),
        ("{a: -0.1}", "parameter a of ground_effect.exponential is -0.1, expected a number from 0 to 5"),
        ("{b: 0.1}", "parameter b of ground_effect.exponential is 0.1, expected a number from 0.3 to 100 1/m"),
        ("{a: .nan}", "parameter a of ground_effect.exponential is nan, expected a number from 0 to 5"),
        ("{a: much}", "parameter a of ground_effect.exponential is much, expected a number from 0 to 5"),
        ("{a: yes}", "parameter a of ground_effect.exponential is True, expected a number from 0 to 5"),
        ("{aa: 1}", "ground_effect.exponential has no parameter 'aa' (did you mean 'a'?)"),
        ("{gain: 1}", "ground_effect.exponential has no parameter 'gain', expected one of: a, b, c"),
        ("[1, 2]", "effects[1].parameters is [1, 2], expected keys and values"),
    ],
)
def test_bad_parameters(tmp_path: Path, raptor_path: Path, parameters: str, said: str) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(f"vehicle: {raptor_path}\neffects: [{{effect: exponential, parameters: {parameters}}}]")
    with pytest.raises(SettingsError) as caught:
        load_model(path)
    assert said in checked_sentence(str(caught.value), path)


def test_an_effect_without_parameters_takes_none(tmp_path: Path, raptor_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(f"vehicle: {raptor_path}\neffects: [{{effect: cheeseman, parameters: {{a: 1}}}}]")
    with pytest.raises(SettingsError, match=r"ground_effect\.cheeseman has no parameter 'a', expected none$"):
        load_model(path)


def test_a_problem_of_an_inline_vehicle_is_said_where_it_is(tmp_path: Path, vehicle_data: dict[str, Any]) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(yaml.safe_dump({"vehicle": changed(vehicle_data, "mass_kg", -1.0)}))
    with pytest.raises(SettingsError, match=r"model\.yaml: vehicle\.mass_kg is -1\.0, expected greater than 0$"):
        load_model(path)


def test_a_model_whose_vehicle_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text("vehicle: nowhere.yaml\n")
    with pytest.raises(SettingsError, match=r"nowhere\.yaml: there is no such file$"):
        load_model(path)


def test_the_shipped_vehicle_is_valid(raptor_path: Path) -> None:
    assert load_vehicle(raptor_path).name == "raptor"


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        ("vehicle: raptor.yaml\neffects: []\n", "is a model, expected a vehicle file"),
        ("name: hop\nphases: []\n", "is a mission, expected a vehicle file"),
        ("vehicle: raptor.yaml\nguards: {}\n", "is a flight configuration, expected a vehicle file"),
    ],
)
def test_a_file_of_another_kind_is_called_what_it_is(tmp_path: Path, content: str, kind: str) -> None:
    path = tmp_path / "given.yaml"
    path.write_text(content)
    with pytest.raises(SettingsError, match=f"given.yaml: {kind}$"):
        load_vehicle(path)
