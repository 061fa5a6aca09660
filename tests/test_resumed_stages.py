"""A process that resumes must have the stages by which the states in its checkpoint were made."""

import pytest

import formingx as fx
from formingx.__main__ import main


def scene():
    """A sheet that relaxes, under air, with a ball above it."""
    return fx.Scene(mesh=fx.mesh.disc(radius=20.0, thickness=0.5, elements=(6, 1)),
                    materials=fx.Viscoelastic(fx.NeoHookean(c10=0.3), [(0.3, 1.0)]),
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    loads=[fx.Pressure("bottom", name="air")],
                    contacts=[fx.Contact("top", fx.tools.sphere(radius=9.0, z=2.5), "none", direction=(0, -1),
                                         name="ball")])


def stages(speed=0.02, pressure=0.01, table=((1, 0), (3, 5.0)), **more):
    return [fx.Stage("air", control="air", until=fx.pressure(pressure), speed=speed, **more),
            fx.Stage("ball", amplitudes={"ball": table})]


def resumed(given, folder):
    return fx.Process(scene()).run(given, accuracy="draft", checkpoint=folder, resume=True, progress=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "run"
    resumed(stages(), folder)
    return folder


@pytest.mark.parametrize("change, message", [
    ({"speed": 0.01}, "stage 'air': speed = 0.02 there, 0.01 here"),
    ({"pressure": 0.02}, "stage 'air': until = 'pressure 0.01' there, 'pressure 0.02' here"),
    ({"inactive": ["ball"]}, "stage 'air': inactive"),
    ({"table": [(1, 0), (3, 4.0)]}, "stage 'ball': the amplitudes differ before the process time 3"),
])
def test_other_stages_are_refused(change, message, folder):
    with pytest.raises(fx.InputError, match=message):
        resumed(stages(**change), folder)


def test_fewer_stages_are_refused(folder):
    with pytest.raises(fx.InputError, match="its last state is of stage 2, 'ball', but the process has 1 now"):
        resumed(stages()[:1], folder)


def test_the_last_stage_continues_to_another_end(folder):
    assert resumed(stages(), folder).last.time == pytest.approx(3.0)
    longer = [(1, 0), (3, 5.0), (4, 5.0)]
    path = resumed([*stages(table=longer), fx.Stage("hold", duration=1.0)], folder)
    assert path.last.time == pytest.approx(5.0) and path["ball_travel"][-1] == pytest.approx(5.0)


def test_status_names_the_target_of_a_stage_with_a_speed(tmp_path, capsys):
    """Process time controls such a stage; the target is the only pressure."""
    fx.Process(scene()).run(stages()[:1], accuracy="draft", checkpoint=tmp_path / "run", progress=False)
    assert main(["status", str(tmp_path / "run")]) == 0
    said = capsys.readouterr().out
    assert "stage 'air': air pressure 0.01 of 0.01" in said and "the target is met" in said


def test_status_knows_that_a_target_without_a_column_is_met(tmp_path, capsys):
    """A displacement is no column of the path."""
    until = fx.displacement(0.3, at=(1.0, 0.0), component="z")
    sheet = fx.Scene(mesh=fx.mesh.disc(radius=2.0, thickness=0.1, elements=(6, 1)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    fx.trace(sheet, until=until, checkpoint=tmp_path / "run", progress=False)
    assert main(["status", str(tmp_path / "run")]) == 0 and "the target is met" in capsys.readouterr().out


@pytest.mark.parametrize("lift", (0.7, 1.4))
def test_a_run_continues_after_the_release_of_a_tool_that_is_free(lift, tmp_path):
    """The stage that releases it has one state, in equilibrium: nothing fades, and the same states follow."""
    def pushed():
        mesh = fx.mesh.disc(radius=20.0, thickness=0.5, elements=(6, 1))
        return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.3),
                        supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                        loads=[fx.Pressure("bottom", name="air")],
                        contacts=[fx.Contact("top", fx.tools.sphere(radius=9.0, z=2.5), "none", direction=(0, -1),
                                             name="ball")])
    down_up = [fx.Stage("down", control="ball", until=fx.travel(5.0)),
               fx.Stage("up", control="ball", until=fx.travel(lift)), fx.Stage("off", inactive=["ball"])]
    blow = fx.Stage("blow", control="air", until=fx.pressure(0.004), inactive=["ball"])
    whole = fx.Process(pushed()).run([*down_up, blow], progress=False)
    fx.Process(pushed()).run(down_up, progress=False, checkpoint=tmp_path / "run")
    released = pushed()
    path = fx.load(tmp_path / "run", released)
    assert [s.stage for s in path.states].count("off") == 1 and not path.last.setting["fading"]
    for again in (fx.Process(released).run([*down_up, blow], progress=False, start=path),
                  fx.Process(pushed()).run([*down_up, blow], progress=False, checkpoint=tmp_path / "run", resume=True)):
        assert again["pole_height"] == pytest.approx(whole["pole_height"], rel=1e-9)
