"""Exact-contact motion against exact answers: impact, rest, bounce, sliding to a stop, growth of a mode."""

import h5py
import numpy as np
import pytest
from conftest import INPUTS
from models import write_matrices, write_scene, write_state

both = pytest.mark.parametrize("ranks", [1, 2])
OFF = {"enabled": False}


def history_of(run, defect=1e-12):
    with h5py.File(run.output / "history.h5") as file:
        data = {name: value[:] for name, value in file["transient"].items() if name != "probes"}
        data.update({name: value[:] for name, value in file["transient/probes"].items()})
    # the energy identity of the scheme, in every step
    assert run.report["transient"]["energy_defect_max"] < defect
    return data


def march(converged, folder, ranks, u, v, steps, step_size, defect=1e-12, **tables):
    """From a state file; the modes about the rest state are of no interest."""
    state = write_state(folder / "start.state", u, v)
    scene = write_scene(folder, title="motion", estimate=OFF, **tables,
                        transient={"start": state.name, "steps": steps, "step_size": step_size})
    return history_of(converged(scene, ranks=ranks), defect)


def mass_above_ground(gap, mass=2.0, g=9.81):
    return {"point": [{"name": "floor", "at": [0, 0, 0], "free": "none"},
                      {"name": "mass", "at": [0, 0, 0], "mass": mass, "free": "y"}],
            "contact": [{"rotor": "floor", "stator": "mass", "normal": "y", "tangents": [[1, 0, 0]], "gap": gap}],
            "force": [{"on": "mass", "vector": [0, -mass * g, 0]}], "friction": {"coefficient": 0.0},
            "probe": [{"name": "height", "on": "mass", "direction": "y"}]}


@both
def test_a_falling_mass_meets_the_ground_and_stays(converged, tmp_path, ranks):
    h = 4e-3
    data = march(converged, tmp_path, ranks, [0], [0], 170, h, **mass_above_ground(1.0))
    time, gap = data["time"], 1 + data["height"]
    impact = time[np.argmax(data["open"] == 0)]
    assert abs(impact - 0.451523640986) <= h
    flight = time < impact
    assert gap[flight] == pytest.approx(1 - 9.81 * time[flight]**2 / 2, abs=1e-12)  # a parabola, integrated exactly
    rest = time > impact + 2.5 * h  # an inelastic shock takes two steps
    assert np.abs(gap[rest]).max() < 1e-10 * 9.81 * h**2  # the contact tolerance, over a step
    assert data["normal_force"][rest] == pytest.approx(2 * 9.81, rel=1e-9)
    assert data["open"][rest].max() == 0


@both
@pytest.mark.parametrize("gap", [0.0, 1e-20, -1e-20])
def test_a_pressed_mass_stays_pressed(converged, tmp_path, gap, ranks):
    data = march(converged, tmp_path, ranks, [0], [0], 20, 1e-3, **mass_above_ground(gap))
    assert data["open"].max() == 0
    assert data["normal_force"] == pytest.approx(2 * 9.81, rel=1e-10)
    assert np.abs(data["height"]).max() < 1e-15


def bouncing_bar(converged, folder, ranks, elements, steps_per_second, end):
    """Doyen, Ern, Piperno 2011: E 900, rho 1, length 10, weight 10, dropped from 5; lumped mass. Start energy: none."""
    n, length = elements + 1, 10 / elements
    K = 900 / length * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    K[0, 0] = K[-1, -1] = 900 / length
    mass = np.full(n, length)
    mass[[0, -1]] /= 2
    bottom = np.eye(2, n)
    bottom[1] = 0
    write_matrices(folder / "bar", bottom, [5.0], [0.0], -10 * mass, M=np.diag(mass), C=0 * K, K=K)
    data = march(converged, folder, ranks, np.zeros(n), np.zeros(n), round(end * steps_per_second), 1 / steps_per_second,
                 matrices={"folder": "bar"}, friction={"coefficient": 0.0}, modes=OFF,
                 defect=1e-14 * max(elements, 100),  # rounding of K u, which grows with the elements next to the load
                 probe=[{"name": "bottom", "on": "dof:0"}, {"name": "top", "on": f"dof:{elements}"}])
    data["gap"] = 5 + data["bottom"]
    data["loss"] = np.cumsum(data["load_power"]) / steps_per_second - data["energy"]
    return data


@pytest.mark.parametrize("elements, ranks", [(50, 1), (50, 2), (200, 1)])
def test_a_bar_bounces_as_its_wave_comes_back(converged, tmp_path, elements, ranks):
    """A front smears over N^(-2/3) of the bar (third-order dispersion), and so do the events that it brings."""
    rate = 10 * elements  # a step is .3 of a wave's way through an element
    data = bouncing_bar(converged, tmp_path, ranks, elements, rate, 5.4)
    time, front = data["time"], elements**(-2 / 3)
    touching = (data["open"] == 0).astype(int)
    events = time[1 + np.flatnonzero(np.diff(touching))]
    assert len(events) == 4
    assert events == pytest.approx([1, 5 / 3, 11 / 3, 13 / 3], abs=0.3 * front)
    at = {t: round(t * rate) - 1 for t in (2, 2.2, 8 / 3)}
    assert [data["gap"][i] for i in at.values()] == pytest.approx([1.666667, 3.2, 3.888889], abs=0.4 * front)
    # a front passes the top at 2 and at 8/3
    assert [data["top"][i] for i in at.values()] == pytest.approx([-2.222222, -2.022222, 0], abs=1.5 * front)
    pressed = (time > 1.1) & (time < 1.5)  # behind the front's ripple
    assert np.polyfit(time[pressed] - 1, data["normal_force"][pressed], 1) == pytest.approx([300, 300], rel=0.002)
    # the modified law keeps u + h v/2 from penetrating, which is the mean of two displacements
    assert (data["gap"][1:] + data["gap"][:-1]).min() > -1e-10


def test_the_energy_of_an_impact_is_lost_like_one_over_the_elements(converged, tmp_path):
    """The end node's mass stops dead: with a step of a fixed part of the element, exactly like 1/N; 1e-3."""
    loss = {}
    for elements in (50, 200, 800):
        folder = tmp_path / str(elements)
        folder.mkdir()
        data = bouncing_bar(converged, folder, 1, elements, 3 * elements, 1.1)
        loss[elements] = data["loss"][-1]
        assert data["contact_power"].max() < 1e-9 * 900  # no step gains energy from contact
    assert loss[50] / loss[200] == pytest.approx(4, rel=1e-3)
    assert loss[200] / loss[800] == pytest.approx(4, rel=1e-3)


@both
def test_a_brick_slides_to_a_stop_where_coulomb_says(converged, tmp_path, ranks):
    """v0 = 2, mu = .3: it stops after .679578661230 s and m. Seen from a belt that catches it; the spring that a sliding
    equilibrium needs is soft, and counted: x = mu g/w^2 (1 - cos w t)."""
    mu, g, speed, h, mass, omega = 0.3, 9.81, 2.0, 4e-3, 3.0, 1e-3
    data = march(converged, tmp_path, ranks, [0, 0], [0, 0], 190, h, modes=OFF, friction={"coefficient": mu},
                 point=[{"name": "belt", "at": [0, 0, 0], "free": "none"},
                        {"name": "brick", "at": [0, 0, 0], "mass": mass, "free": "x y"}],
                 spring=[{"from": "brick", "to": "ground", "direction": "x", "stiffness": mass * omega**2}],
                 force=[{"on": "brick", "vector": [0, -mass * g, 0]}],
                 contact=[{"rotor": "belt", "stator": "brick", "normal": "y", "tangents": [[1, 0, 0]],
                           "velocity": [speed, 0, 0]}],
                 probe=[{"name": "brick", "on": "brick", "direction": "x"}])
    stop = np.arcsin(speed * omega / (mu * g)) / omega
    slipped = speed * stop - mu * g / omega**2 * (1 - np.cos(omega * stop))
    assert [stop, slipped] == pytest.approx(2 * [0.679578661230], rel=1e-6)
    caught = np.argmax(data["stick"])
    assert abs(data["time"][caught] - stop) <= h
    assert data["stick"][caught:].min() == 1
    # exact up to the step of the stop, which is travelled at half speed: at most (mu g h) h/8
    assert abs(speed * data["time"][-1] - data["brick"][-1] - slipped) < mu * g * h**2 / 8 + 1e-9


OSCILLATOR = [INPUTS / "oscillator" / "scene.toml", "--set", "cycle.enabled=false", "--set", "transient.enabled=true"]


@both
@pytest.mark.parametrize("theta, steps", [(0.5, 50), (0.5, 400), (0.55, 50)])
def test_a_mode_grows_at_its_discrete_rate(converged, theta, steps, ranks):
    """lambda_h = ln((1 + (1 - theta) lambda h)/(1 - theta lambda h))/h, fitted over 5 periods far below lift-off: 1e-6."""
    run = converged(*OSCILLATOR, "--set", "contact.0.velocity=[1,0,0]", "--set", f"transient.theta={theta}", "--set",
                    f"transient.steps_per_period={steps}", "--set", "transient.periods=5", "--set",
                    "transient.amplitude=0.01", "--set", "friction.coefficient=0.9", ranks=ranks)
    mode, transient = run.report["modes"]["modes"][0], run.report["transient"]
    growth = mode["growth_rate"] + 2j * np.pi * mode["frequency_hz"]
    h = transient["step_size"]
    assert h == pytest.approx(2 * np.pi / growth.imag / steps, rel=1e-12)
    predicted = (np.log((1 + (1 - theta) * growth * h) / (1 - theta * growth * h)) / h).real
    assert transient["growth_rate_predicted"] == pytest.approx(predicted, rel=1e-9)
    assert transient["growth_rate_fit"] == pytest.approx(predicted, rel=1e-6)
    assert transient["energy_defect_max"] < 1e-12


def test_a_step_that_would_show_a_growing_mode_as_stable_is_refused(squeal):
    """A mode of .1 % at theta = .51 and 50 steps a period; marched all the same in verify/dynamics, it decays."""
    run = squeal(*OSCILLATOR, "--set", "friction.coefficient=0.1766", "--set", "transient.theta=0.51", "--set",
                 "transient.steps_per_period=50", ranks=2)
    mode = run.report["modes"]["modes"][0]
    assert 0 < mode["growth_rate"] < 0.0013 * 2 * np.pi * mode["frequency_hz"]
    assert run.code == 2 and run.report["transient"]["outcome"] == "refused"
    assert "2 pi (theta - 1/2) omega/sigma" in run.report["transient"]["reason"]
