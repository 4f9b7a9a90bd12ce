"""Cases that extend others: merging and replacing, and the file named in an error."""

from __future__ import annotations

import pytest

from castfem.base.errors import InputError
from castfem.model import load_case
from castfem.model.shipped_cases import shipped


def test_extends_merges_tables_and_replaces_arrays(write, sound):
    write(sound, "base/base.toml")
    write('extends = "base.toml"\n[casting]\nspeed = "1 m/min"\n', "base/middle.toml")
    path = write(
        'extends = "base/middle.toml"\ntitle = "top"\n[[cooling]]\nname = "all"\n', "top.toml"
    )
    case = load_case(path)
    assert case.title == "top"
    assert case.casting.speed == pytest.approx(1 / 60)
    assert case.casting.length == 0.6
    assert [zone.name for zone in case.cooling] == ["all"]
    assert case.zones()[0].laws == ()


def test_later_of_two_exclusive_keys_wins(write, sound):
    write(sound + '[thermal.time.adaptive]\ntolerance = "1 K"\n', "base.toml")
    path = write(
        'extends = "base.toml"\n[casting]\ntemperature = "1550 degC"\n'
        '[thermal.time]\nstep = "50 ms"\n'
    )
    case = load_case(path)
    assert (case.casting.superheat, case.casting.temperature) == (None, 1823.15)
    assert (case.thermal.time.step, case.thermal.time.adaptive) == (0.05, None)
    again = load_case(path, ["casting.superheat=10 K"])
    assert (again.casting.superheat, again.casting.temperature) == (10.0, None)


def test_another_shape_replaces_the_section(write, sound):
    write(sound, "base.toml")
    path = write('extends = "base.toml"\n[section]\nshape = "round"\ndiameter = "200 mm"\n')
    assert load_case(path).section.diameter == 0.2


def test_problems_name_the_file_of_the_chain(write, sound):
    base = write(sound.replace('"5 mm"', '"5 kg"'), "base.toml")
    top = write('extends = "base.toml"\n[casting]\nsped = "1 m/s"\n', "top.toml")
    with pytest.raises(InputError) as caught:
        load_case(top, ["mesh.order=7"])
    assert [line.partition(": ")[0] for line in sorted(caught.value.problems)] == [
        "--set",
        str(base),
        str(top),
    ]


def test_mistake_of_two_keys_names_the_last_file_of_both(write, sound):
    base = write(sound, "base.toml")
    both = '[casting]\nsuperheat = "30 K"\ntemperature = "1540 degC"\n'
    top = write(f'extends = "base.toml"\n{both}', "top.toml")
    with pytest.raises(InputError) as caught:
        load_case(top)
    (line,) = caught.value.problems
    assert line.startswith(f"{top}: casting: superheat and temperature exclude")
    write('extends = "top.toml"\n[mesh]\norder = 2\n', "last.toml")
    with pytest.raises(InputError, match=f"^{top}: casting: superheat and temperature exclude"):
        load_case(top.parent / "last.toml")
    write('casting = 3\nextends = "top.toml"\n', "last.toml")  # nothing was merged here
    with pytest.raises(InputError, match=f"^{top.parent}/last.toml: casting: "):
        load_case(top.parent / "last.toml")
    write(sound.replace('"5 mm"', '"70 mm"'), "base.toml")
    write('extends = "base.toml"\n[casting]\nspeed = "3 m/min"\n', "top.toml")
    with pytest.raises(InputError, match=f"^{base}: section.corner_radius"):
        load_case(top)


def test_exclusive_keys_name_the_file_of_the_later_one(write, sound):
    spray = 'law = "spray"\nflow = "9 L/min"\ncorrelation = "nozaki"\nwater_temperature = "25 degC"'
    write(sound + f"[[cooling.surface]]\n{spray}\n", "base.toml")
    more = write('extends = "base.toml"\n[cooling.air.spray]\nshare = 0.5\n', "more.toml")
    write('extends = "more.toml"\n[cooling.air.spray]\nmachine_factor = 4\n', "last.toml")
    for name, overrides, where in (
        ("last", [], str(more)),
        ("base", ["cooling.air.spray.share=0.5"], "--set"),
    ):
        with pytest.raises(InputError) as caught:
            load_case(more.parent / f"{name}.toml", overrides)
        found = [p for p in caught.value.problems if "flow and share exclude each other" in p]
        assert [line.partition(": ")[0] for line in found] == [where]


def test_extends_in_a_circle(write):
    write('extends = "b.toml"\n', "a.toml")
    path = write('extends = "a.toml"\n', "b.toml")
    with pytest.raises(InputError, match=r"leads back to itself: b\.toml -> a\.toml -> b\.toml"):
        load_case(path)


def test_extended_file_not_found(write, sound):
    write(sound, "base.toml")
    path = write('extends = "bsae.toml"\n')
    with pytest.raises(InputError) as caught:
        load_case(path)
    assert str(caught.value) == (
        f'{path}: extends ("bsae.toml"): no such case file, and no shipped case of that name '
        "(castfem cases lists them); did you mean base.toml?"
    )


def test_extends_a_shipped_case_by_its_name(write):
    """As in `castfem run`; a file of that name next to the case has precedence."""
    path = write('extends = "billet125/thermal"\n[casting]\nlength = "20 mm"\n')
    case, whole = load_case(path), load_case(shipped()["billet125/thermal"])
    assert case.casting.length == 0.02
    assert case.cooling == whole.cooling and case.section == whole.section
    write('extends = "slab1200/thermal"\ntitle = "beside"\n', "billet125/thermal.toml")
    assert load_case(path).title == "beside"
    with pytest.raises(InputError, match=r'extends \("billet125/themal"\).*did you mean billet125'):
        load_case(write('extends = "billet125/themal"\n'))


def test_syntax_error_in_the_extended_file(write):
    base = write("[casting\n", "base.toml")
    with pytest.raises(InputError, match="line 1"):
        load_case(write('extends = "base.toml"\n'))
    with pytest.raises(InputError) as caught:
        load_case(write('extends = "base.toml"\n'))
    assert str(caught.value).startswith(str(base))
