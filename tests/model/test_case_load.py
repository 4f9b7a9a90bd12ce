"""Loading: overrides, the resolved case, the hash of the physics."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib

import pytest

from castfem.base.errors import InputError
from castfem.model import Adaptive, Contact, from_document, load_case
from castfem.model.load import load
from castfem.model.shipped_cases import shipped

MOULD = ("mould.length=600 mm", "mechanics.law=norton_hoff_kozlowski", "mesh.order=2",
    "cooling.mould.surface.0.gap_conductivity=0.15 W/(m K)",
)  # fmt: skip


def test_values_are_si(write):
    case = load_case(write())
    assert case.casting.speed == 0.06
    assert case.casting.duration == pytest.approx(10.0)
    assert case.section.corner_radius == 0.005
    law = case.cooling[0].surface[0]
    assert isinstance(law, Contact)
    assert (law.coefficient, law.wall, law.gap) == (1600.0, 433.15, None)
    assert case.thermal.time.adaptive == Adaptive.model_validate({})


def test_zones_are_cut_at_the_followed_length(write, sound):
    spans = load_case(write()).zones()
    assert [(s.name, s.start, s.end) for s in spans] == [("mould", 0.0, 0.6)]
    spans = load_case(write(), ["casting.length=20 m"]).zones()
    assert [(s.name, s.start, s.end) for s in spans] == [("mould", 0.0, 0.6), ("air", 0.6, 20.0)]
    assert spans[1].laws[0][0] == ("wide_face", "narrow_face", "corner")
    assert [span.whole for span in spans] == [True, False]  # the air continues below
    (within,) = load_case(write(), ["casting.length=0.4 m"]).zones()
    assert (within.end, within.whole) == (0.4, False)


def test_mould_ends_by_its_table_or_its_zones(write, sound):
    assert load_case(write()).mould_exit() == 0.6
    assert load_case(write(), MOULD).mould_exit() == 0.6
    deeper = load_case(write(), ["casting.length=0.4 m", *MOULD[1:], "mould.length=800 mm"])
    assert deeper.mould_exit() == 0.8  # its end is beyond the run
    parts = "".join(
        f'[[cooling]]\nname = "{name}"\nto = "{to} mm"\n[[cooling.surface]]\nlaw = "{law}"\n'
        for name, to, law in (
            *((f"mould {i}", 150 * i, 'flux"\nvalue = "2 MW/m^2') for i in (1, 2, 3, 4)),
            ("foot rolls", 700, 'contact"\ncoefficient = "900 W/(m^2 K)"\nwall = "90 degC'),
            ("mould of another name", 900, 'flux"\nvalue = "1 MW/m^2'),
        )
    )
    zones = sound[: sound.index("[[cooling]]")] + parts
    assert load_case(write(zones)).mould_exit() == 0.6
    # Without the name the wall identifies the mould, without a wall there is none.
    assert load_case(write(), ["cooling.0.name=A"]).mould_exit() == 0.6
    assert load_case(write(zones), ["cooling.0.name=A"]).mould_exit() is None


def test_keys_of_omitted_tables_have_bare_names(write):
    case = load_case(write(), ["figures=false", "every=1 s", "largest=1 s"])
    assert not case.output.figures and case.output.every == 1.0
    assert case.thermal.time.adaptive.largest == 1.0
    with pytest.raises(InputError, match=r"did you mean mould\.friction"):
        load_case(write(), ["friction=1"])
    with pytest.raises(InputError, match=r"did you mean coupling\.interval"):
        load_case(write(), ["interval=1 s"])


def test_key_of_the_adaptive_step_replaces_a_fixed_one(write, sound):
    text = sound + '[thermal.time]\nstep = "1 s"\n'
    case = load_case(write(text), ['thermal.time.adaptive.tolerance="0.3 K"'])
    assert case.thermal.time.step is None
    assert case.thermal.time.adaptive.tolerance == 0.3
    assert load_case(write(text), ["tolerance=0.3 K", "step=2 s"]).thermal.time.adaptive is None


def test_sharp_corners_have_no_corner_group(write, sound):
    case = load_case(write(sound.replace('corner_radius = "5 mm"\n', "")))
    assert case.zones()[0].laws[0][0] == ("wide_face", "narrow_face")


def test_strip_is_cooled_at_its_surface(write, sound):
    text = sound.replace('shape = "rectangle"', 'shape = "strip"\nlength = "50 mm"').replace(
        'width = "125 mm"\nheight = "125 mm"\ncorner_radius = "5 mm"', 'width = "1 mm"'
    )
    assert load_case(write(text)).zones()[0].laws[0][0] == ("surface",)


@pytest.mark.parametrize(
    ("assignment", "attribute", "value"),
    [
        ("casting.length=20 m", lambda c: c.casting.length, 20.0),
        ("mesh.order=2", lambda c: c.mesh.order, 2),
        ("output.figures=false", lambda c: c.output.figures, False),
        ("output.fields=[]", lambda c: c.output.fields, ()),
        ("cooling.0.surface.0.wall=200 degC", lambda c: c.cooling[0].surface[0].wall, 473.15),
        ("cooling.mould.surface.0.wall=200 degC", lambda c: c.cooling[0].surface[0].wall, 473.15),
        ("steel.composition.C=0.2", lambda c: c.steel.composition, {"C": 0.2}),
    ],
)
def test_override(write, assignment, attribute, value):
    assert attribute(load_case(write(), [assignment])) == value


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("casting.length", "write it as key=value"),
        ("casting.lenght=1 m", "casting.lenght: unknown key"),
        ("casting.speed.x=1", "casting.speed is a single value"),
        ("cooling.7.to=1 m", "'7' is not an entry of cooling; give an index from 0 to 1"),
        ("casting.length=3", "needs its unit"),
        ("friction.law=coulomb", 'unknown key ({ law = "coulomb" }); allowed: title'),
        ("time.step=1 s", "; did you mean thermal.time?"),
    ],
)
def test_bad_override(write, assignment, message):
    with pytest.raises(InputError) as caught:
        load_case(write(), [assignment])
    assert all(line.startswith("--set: ") for line in caught.value.problems)
    assert message in str(caught.value)


MOULD_WORD = "[mould]\ncontact = %s\n"


def test_keys_join_the_model_of_bulging_of_one_word():
    case = shipped()["slab1200/bulging"]
    bulging = load_case(case, ["mechanics.bulging.axial_strain=true"]).mechanics.bulging
    assert bulging.model == "creep" and bulging.axial_strain
    assert load_case(case, ["mechanics.bulging.model=elastic"]).mechanics.bulging.model == "elastic"
    again = ["mechanics.bulging.axial_strain=true", "mechanics.bulging=elastic"]
    bulging = load_case(case, again).mechanics.bulging
    assert bulging.model == "elastic" and not bulging.axial_strain


def test_keys_join_the_method_of_contact_of_one_word(write, tmp_path):
    """In the same case, and in one that extends it: the method is kept."""
    nitsche = [*MOULD, "mould.contact=nitsche"]
    touch = load_case(write(), [*nitsche, "mould.contact.factor=9"]).mould.contact
    assert (touch.method, touch.factor) == ("nitsche", 9.0)
    base = load_case(write(), nitsche)
    (tmp_path / "base.toml").write_text(base.resolved_toml())
    inherits = tmp_path / "more.toml"
    for text, method in [("factor = 9", "nitsche"), ('factor = 9\nmethod = "penalty"', "penalty")]:
        base_text = MOULD_WORD % '"nitsche"'
        inherits.write_text(f'extends = "word.toml"\n[mould.contact]\n{text}\n')
        (tmp_path / "word.toml").write_text(f'extends = "base.toml"\n{base_text}')
        touch = load_case(inherits).mould.contact
        assert (touch.method, touch.factor) == (method, 9.0)
    inherits.write_text('extends = "word.toml"\n[mould.contact]\nfactor = 2\n')
    with pytest.raises(InputError, match=r"factor: .* too small for Nitsche"):
        load_case(inherits)


def test_word_in_place_of_a_table_is_reported_with_a_fix(write):
    """The proposal of the message is valid."""
    with pytest.raises(InputError) as caught:
        load_case(write(), [*MOULD, "mould.friction=coulomb"])
    (line,) = caught.value.problems
    fix = line.partition("such as ")[2].partition(" (")[0]
    assert load_case(write(), [*MOULD, f"mould.friction={fix}"]).mould.friction.law == "coulomb"


def test_resolved_case_reads_back_equal(write, sound, tmp_path):
    text = sound + (
        '[cooling.surface.emissivity]\ntemperature = ["20 degC", "333 K"]\nvalue = [0.1, 0.3]\n'
        '[[reference]]\nquantity = "shell_mid_face"\nvalue = "4.75 mm"\nsource = "x"\n'
        '[thermal]\nsolver = { snes_rtol = 1e-9, ksp_type = "preonly" }\n'
    )
    case = load_case(write(text), ["casting.length=1.7 m", "casting.speed=1.1 m/min"])
    resolved = case.resolved_toml()
    again = load_case(write(resolved, "elsewhere/case.toml"))
    assert again == case
    assert again.resolved_toml() == resolved
    assert "extends" not in tomllib.loads(resolved)


@pytest.mark.parametrize(
    ("name", "value", "sound"),
    [
        ("ksp_rtol", -1, False), ("snes_atol", "-1e-9", False),
        ("fieldsplit_0_ksp_max_it", -1, False),
        ("ksp_rtol", "1e-9", True), ("snes_linesearch_damping", -1, True), ("ksp_rtol", "x", True),
    ],
)  # fmt: skip
def test_negative_options_of_a_solver_are_refused(write, name, value, sound):
    """PETSc replaces them by its defaults; it refuses itself what is no number."""
    given = [f'thermal.solver.{name}="{value}"']
    if sound:
        assert load_case(write(), given).thermal.solver == {name: value if value != -1 else "-1"}
        return
    with pytest.raises(InputError, match=rf"thermal\.solver\.{name}: \({value}\): must not be neg"):
        load_case(write(), given)


def test_resolved_case_finds_its_steel_file(write, sound):
    path = write(sound.replace('"carbon_042"', '"../steels/mine.toml"'), "cases/case.toml")
    case = load_case(path)
    assert case.steel.name == str(path.parent.parent / "steels" / "mine.toml")
    assert load_case(write(case.resolved_toml(), "out/case.toml")) == case


def test_hash_depends_on_the_physics_only(write, sound, tmp_path):
    case = load_case(write())
    same = case.with_(
        {"title": "x", "output.every": "1 s", "output.fields": [], "casting.length": "2 m"}
    )
    assert same.physics_hash() == case.physics_hash()
    for key, value in {
        "casting.speed": "3.5 m/min",
        "mesh.surface_size": "0.4 mm",
        "cooling.mould.surface.0.wall": "150 degC",
        "steel.composition": {"C": 0.2},
        "thermal.time.step": "50 ms",
        "section.symmetry": "half",
    }.items():
        assert case.with_({key: value}).physics_hash() != case.physics_hash(), key


def test_hash_depends_on_the_content_of_the_steel_file(write, sound):
    steel = write("a = 1\n", "steel.toml")
    case = load_case(write(sound.replace('"carbon_042"', '"./steel.toml"')))
    before = case.physics_hash()
    assert case.physics_hash() == before
    steel.write_text("a = 2\n")
    assert case.physics_hash() != before


def test_with_returns_a_changed_copy(write):
    case = load_case(write())
    changed = case.with_({"casting.speed": "1.2 m/min"}, title="slow")
    assert (changed.casting.speed, changed.title) == (0.02, "slow")
    assert case.casting.speed == 0.06
    with pytest.raises(InputError, match=r"with_: casting\.speed: .* a speed is needed"):
        case.with_({"casting.speed": "1.2 m"})


def test_from_document(write, sound):
    assert from_document(tomllib.loads(sound)) == load_case(write())
    with pytest.raises(InputError, match=r"table \[casting\] is missing"):
        from_document({"title": "x"})


def test_references_apply_at_the_end_of_the_run(write, sound):
    text = (
        sound + '[[reference]]\nquantity = "gap_max"\nvalue = "1 mm"\nsource = "s"\nat = "600 mm"\n'
    )
    path = write(text)
    assert [r.si for r in load_case(path).expected()] == [0.001]
    assert load_case(path, ["casting.length=1 m"]).expected() == ()


def test_cases_are_loaded_without_heavy_modules(write):
    """Without DOLFINx, MPI, gmsh and plotting."""
    code = (
        "import sys; from castfem.model import load_case; load_case(sys.argv[1]); "
        "bad = {'dolfinx', 'gmsh', 'mpi4py', 'petsc4py', 'ufl', 'matplotlib', 'pandas', "
        "'click', 'rich'} & set(sys.modules); assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code, str(write())], check=True)


def test_commands_load_without_the_models_of_cases():
    """`castfem --help` and completion need neither numpy nor pydantic."""
    code = (
        "import sys, castfem.cli.app; bad = {'numpy', 'pydantic', 'pint', 'castfem.model'} "
        "& set(sys.modules); assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_overrides_take_bare_names(write, sound):
    case = load_case(write(sound), ("speed=3 m/min",))
    assert case.casting.speed == pytest.approx(0.05)
    with pytest.raises(InputError, match=r"--set: sped: .* did you mean casting\.speed\?"):
        load_case(write(sound), ("sped=3 m/min",))


@pytest.mark.parametrize(
    ("short", "value", "full"),
    [
        ("cooling.mould.coefficient", "1200 W/(m^2 K)", "cooling.mould.surface.0.coefficient"),
        ("cooling.0.contact.wall", "90 degC", "cooling.0.surface.0.wall"),
        ("cooling.mould.gap", "0.1 mm", "cooling.mould.surface.0.gap"),  # of its default
        ("cooling.spray 1.emissivity", "0.7", "cooling.spray 1.surface.1.emissivity"),
        ("cooling.spray 1.spray.water", "5 L/(m^2 s)", "cooling.spray 1.surface.0.water"),
        ("cooling.spray 1.to", "2 m", "cooling.spray 1.to"),  # the zone's own
    ],
)
def test_heat_law_of_a_zone_may_be_omitted(short, value, full):
    short_case, full_case = (load("billet125/thermal").with_({k: value}) for k in (short, full))
    assert short_case.document() == full_case.document()
    assert short_case.document() != load("billet125/thermal").document()


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("cooling.air.ambient", r"several heat laws of zone air have it \(radiation, convection\)"),
        ("cooling.air.watr", "unknown key .*; allowed: name, to, surface"),
        ("cooling.moud.coefficient", "'moud' is not an entry of cooling"),
    ],
)
def test_ambiguous_heat_law_is_refused(key, text):
    with pytest.raises(InputError, match=text):
        load("billet125/thermal").with_({key: "20 degC"})


def test_title_contains_the_changes(write, sound):
    plain = load_case(write()).title
    changes = ["casting.speed=3 m/min", "output.figures=false"]
    case = load_case(write(), changes)
    assert case.title == f"{plain}; casting.speed = 3 m/min"
    assert case.with_(speed="4 m/min").title == f"{plain}; casting.speed = 4 m/min"
    assert case.with_(title="mine").title == "mine"
    assert case.physics_hash() == case.with_(title="mine").physics_hash()
    many = [f"mesh.{k}_size=9 mm" for k in ("surface", "corner", "face", "core")]
    assert load_case(write(), many).title.endswith("; mesh.face_size = 9 mm; and 1 more")
    long = [f"thermal.solver.{'x' * 50}{i}=5" for i in range(10)]
    title = load_case(write(), long).title
    assert len(title) < 130 and re.search(r"; and \d+ more$", title)
    title = load_case(write(), [*many, "casting.speed=3 m/min"]).title
    assert title.startswith(f"{plain}; casting.speed = 3 m/min; mesh.surface_size")
