from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import Field, model_validator

from particell.cases import CASES, recorded
from particell.cases.base import Case, Length, Metric, Quantity, Time
from particell.cases.poiseuille import Poiseuille
from particell.errors import InputError


class Example(Case):
    name = "example"
    title = "An example"

    size: Annotated[Length, Field(gt=0)] = 1e-6
    """How large."""
    centre: tuple[Length, Length] = (0.0, 0.0)
    gap: Length | None = None
    rate: Annotated[float, Quantity("m^3/s")] = 0.0
    resolution: Annotated[int, Field(ge=4)] = 10
    mode: Literal["slow", "fast"] = "slow"
    until: Time = 1.0
    every: Time = 0.1

    @model_validator(mode="after")
    def check(self):
        if self.gap is not None and self.gap > self.size:
            raise InputError("gap", self.gap, f"at most size = {self.size}")
        return self

    def build(self, context):
        raise NotImplementedError

    def analyse(self, run, simulation):
        return {}


def test_units_at_the_edge():
    case = Example(size="3 um", centre=("1 mm", 2), until="5 min", rate="2 m^3/s")
    assert case.size == pytest.approx(3e-6)
    assert case.centre == pytest.approx((1e-3, 2.0))
    assert case.until == pytest.approx(300)
    assert Example(size="2e-6").size == 2e-6
    case.size = "1 nm"
    assert case.size == pytest.approx(1e-9)
    described = case.parameters()
    assert described["size"] == {"value": pytest.approx(1e-9), "unit": "m"}
    assert described["centre"]["unit"] == "m"
    assert described["gap"] == {"value": None, "unit": "m"}
    assert described["resolution"] == {"value": 10, "unit": ""}
    assert Example.describe()[0] == ("size", 1e-6, "m", "How large.")


@pytest.mark.parametrize(
    "given, words",
    [
        ({"size": "3 kg"}, ["size = '3 kg'", "a number in m", "'kilogram'"]),
        ({"size": "3 umm"}, ["size = '3 umm'", "a number in m"]),
        ({"size": "[["}, ["size = '[['", "a number in m"]),
        ({"size": ""}, ["size = ''", "a number in m"]),
        ({"size": "nan"}, ["size = 'nan'", "a number in m"]),
        ({"size": True}, ["size = True", "a number in m"]),
        ({"size": [1]}, ["size = [1]", "a number in m"]),
        ({"size": "-3 um"}, ["size", "greater than 0 m"]),
        ({"centre": ["1 s", 0]}, ["centre.0 = '1 s'"]),
        ({"resolution": 3}, ["resolution = 3", "greater than or equal to 4"]),
        ({"resolution": "many"}, ["resolution = 'many'", "integer"]),
        ({"mode": "fsat"}, ["mode = 'fsat'", "'slow' or 'fast'"]),
        ({"siez": 1}, ["'siez'", "did you mean 'size'"]),
        ({"gap": 1.0}, ["gap = 1.0 is not allowed: it must be at most size"]),
    ],
)
def test_wrong_input_in_one_line(given, words):
    with pytest.raises(InputError) as error:
        Example(**given)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


def test_assignment_is_checked():
    case = Example()
    with pytest.raises(InputError, match="size = 'x'"):
        case.size = "x"
    assert case.size == 1e-6


def test_a_case_must_say_what_it_is():
    with pytest.raises(TypeError, match="needs 'until'"):

        class Endless(Case):
            name = "endless"
            title = "x"

            def build(self, context):
                raise NotImplementedError

            def analyse(self, run, simulation):
                return {}

    with pytest.raises(TypeError):
        Case()


def test_identity_names_the_class_of_what_is_not_the_programs_own():
    own = Poiseuille(resolution=12).identity()
    assert own["case"] == "poiseuille" and own["class"] is None
    assert own["parameters"]["resolution"] == 12
    assert recorded("poiseuille", None) is Poiseuille
    assert Example().identity()["class"] == f"{__name__}:Example"
    # that a name is enough for the program's own holds for all of them
    assert all(reference.startswith("particell.cases.") for reference, _ in CASES.values())


def test_metric():
    assert Metric(-0.5, limit=0.5).passed
    assert not Metric(-0.6, limit=0.5).passed
    assert not Metric(float("nan"), limit=0.5).passed
    assert Metric(3.0).passed
    assert Metric(1.0, 2.0, 3.0, "s").as_dict() == {
        "value": 1.0,
        "paper": 2.0,
        "limit": 3.0,
        "unit": "s",
    }
