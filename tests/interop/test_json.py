"""The JSON is valid by the published schema, holds what the calibration file holds, and five lines of numpy from the documentation apply it."""
import json
import pathlib
import re

import jsonschema
import numpy
from conftest import triad
from test_c import unit_with_effects  # noqa: F401, a fixture

DOCS = pathlib.Path(__file__).parent.parent.parent / "docs"
SCHEMA = json.loads((DOCS / "calibration.schema.json").read_text())


def exported(unit):
    path, result = unit.export("json", name="calibration.json")
    file = json.loads(path.read_text())
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.Draft202012Validator(SCHEMA).validate(file)
    return file, result


def holds(file, table):
    """Whether every number of the TOML is in the JSON under the same name."""
    for key, value in table.items():
        if isinstance(value, dict):
            holds(file[key], value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for one, other in zip(file[key], value, strict=True):
                holds(one, other)
        else:
            assert file[key] == value, key


def test_it_holds_everything_at_one_temperature(unit):
    file, _ = exported(unit)
    holds(file, unit.calibration)
    for sensor in ["gyro", "accel"]:
        table = file[sensor]
        assert {"C", "o", "covariance", "interval_C", "interval_o", "forward", "physical"} <= table.keys()
        p, b = (numpy.array(table["forward"][k]) for k in "Pb")
        assert numpy.allclose(p @ numpy.array(table["C"]), numpy.eye(3), atol=1e-9)
        assert numpy.allclose(p @ numpy.array(table["o"]) + b, 0, atol=1e-6 * numpy.abs(b).max())
    assert any(r["source"].startswith("95 %") and r["rms"] > 0 for r in file["remaining"])


def test_it_holds_curves(thermal_unit):
    file, result = exported(thermal_unit)
    holds(file, thermal_unit.calibration)
    assert len(file["temperature"]["node"]) == 9
    # What is known of the errors is there in words and in numbers.
    assert len(file["remaining"]) == len(result["remaining"]) == sum(line.startswith("  ") for line in file["about"])


def test_it_holds_effects(unit_with_effects):  # noqa: F811
    file, _ = exported(unit_with_effects)
    effects = unit_with_effects.calibration["effect"]
    assert len(file["effect"]) == len(effects) == 12
    key = "nonlinear_parameter"
    for ours, theirs in zip(file["effect"], effects, strict=True):
        assert ours["id"] == theirs["id"]
        by_name = {c["name"]: (c["value"], c["unit"]) for c in ours["coefficients"]}
        assert by_name == {c["name"]: (c["value"], c["unit"]) for c in theirs["coefficients"]}
        assert ours.get(key) is None or ours[key]["value"] == theirs[key]["value"]


def test_the_schema_refuses_what_is_no_calibration(unit):
    file, _ = exported(unit)
    wrong = json.loads(json.dumps(file))
    wrong["gyro"]["C"][0] = [1.0, 2.0]
    assert not jsonschema.Draft202012Validator(SCHEMA).is_valid(wrong)
    del file["gyro"]["o"]
    assert not jsonschema.Draft202012Validator(SCHEMA).is_valid(file)


def test_five_lines_of_the_documentation_apply_it(unit, monkeypatch):
    exported(unit)
    section = (DOCS / "export.md").read_text().split("## JSON")[1].split("\n## ")[0]
    code = re.search(r"```python\n(.*?)```", section, re.S)[1]
    assert len(code.strip().splitlines()) == 5
    monkeypatch.chdir(unit.folder)
    for sensor in ["gyro", "accel"]:
        names = {"sensor": sensor, "u": triad(unit.raw, sensor)}
        exec(code, names)
        assert numpy.allclose(names["x"], triad(unit.applied, sensor), rtol=1e-7, atol=1e-9)
