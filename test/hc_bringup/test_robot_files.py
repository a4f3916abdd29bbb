"""What `hc setup` writes says to ROS what was found, whatever axes and joints are called."""

import numpy as np
import pytest
import yaml

from hc_bringup.robot_files import write_files
from hc_bringup.robot_streams import Stream
from hc_estimator.stream.sensor_setup import SensorProposal, SetupProposal

FORCE = SensorProposal("y", (0.0, 1.0, 0.0), -1, "", 2.3, 0.01, 0.03, 1000.0)
JOINT = SensorProposal("", (), 1, "y", 250.0, 0.04, 0.02, 100.0)


def test_an_axis_and_a_joint_called_y_stand_in_quotation_marks(tmp_path):
    """Regression: ROS read `axis: y` as true, and the estimator ended."""
    time_s = np.arange(100) * 1e-2
    found = SetupProposal(FORCE, JOINT, time_s, np.zeros(100), np.ones(100), ())
    path = tmp_path / "arm.yaml"
    streams = (Stream("/ft", "wrench", 1e3, "ft"), Stream("/joints", "joint", 100.0, ""))
    write_files(path, *streams, found, {})
    text = path.read_text()
    assert '        axis: "y"\n' in text
    assert '        joint: "y"\n' in text
    told = yaml.safe_load(text)["estimator"]["ros__parameters"]["input"]
    assert (told["force"]["axis"], told["position"]["joint"]) == ("y", "y")


def test_numbers_are_numbers_whatever_their_size(tmp_path):
    """Regression: a zero of 0.02 mN was written as 0.0."""
    time_s = np.arange(100) * 1e-2
    for k, zero in enumerate((2e-5, -3e-7, 0.0, 12.34567, 5.0)):
        force = FORCE._replace(zero=zero, scale=2e-11)
        found = SetupProposal(force, JOINT, time_s, np.zeros(100), np.ones(100), ())
        path = tmp_path / f"arm{k}.yaml"
        streams = (Stream("/ft", "wrench", 1e3, "ft"), Stream("/joints", "joint", 100.0, ""))
        write_files(path, *streams, found, {})
        told = yaml.safe_load(path.read_text())["estimator"]["ros__parameters"]["input"]["force"]
        assert told["zero"] == pytest.approx(zero, rel=1e-4)
        assert told["scale"] == 2e-11
        assert isinstance(told["zero"], float)


def test_a_range_that_was_reached_is_written_as_a_limit(tmp_path):
    time_s = np.arange(100) * 1e-2
    found = SetupProposal(FORCE, JOINT, time_s, np.zeros(100), np.ones(100), ())
    streams = (Stream("/ft", "wrench", 1e3, "ft"), Stream("/joints", "joint", 100.0, ""))
    for name, limit in (("open.yaml", np.nan), ("ends.yaml", 7.0)):
        write_files(tmp_path / name, *streams, found._replace(force_limit=limit), {})
        told = yaml.safe_load((tmp_path / name).read_text())["estimator"]["ros__parameters"]
        assert told.get("force_limit", np.nan) == pytest.approx(limit, nan_ok=True)


def test_a_delay_that_several_places_said_is_written_down(tmp_path):
    time_s = np.arange(100) * 1e-2
    found = SetupProposal(FORCE, JOINT, time_s, np.zeros(100), np.ones(100), ())
    path = tmp_path / "arm.yaml"
    streams = (Stream("/ft", "wrench", 1e3, "ft"), Stream("/joints", "joint", 100.0, ""))
    write_files(path, *streams, found, {"channel_delay": -0.006})
    told = yaml.safe_load(path.read_text())["estimator"]["ros__parameters"]
    assert told["channel_delay"] == -0.006


@pytest.mark.parametrize("simulated", [True, False])
def test_the_time_of_a_simulation_is_written_down(tmp_path, simulated):
    """Regression: of sensors stamped by /clock the node said for ever that clocks differ."""
    time_s = np.arange(100) * 1e-2
    found = SetupProposal(FORCE, JOINT, time_s, np.zeros(100), np.ones(100), ())
    path = tmp_path / "arm.yaml"
    streams = (Stream("/ft", "wrench", 1e3, "ft"), Stream("/joints", "joint", 100.0, ""))
    write_files(path, *streams, found, {}, simulated=simulated)
    told = yaml.safe_load(path.read_text())["estimator"]["ros__parameters"]
    assert told.get("use_sim_time", False) == simulated


def test_the_command_that_starts_the_run_can_be_pasted(tmp_path):
    time_s = np.arange(100) * 1e-2
    found = SetupProposal(FORCE, JOINT, time_s, np.zeros(100), np.ones(100), ())
    streams = (Stream("/ft", "wrench", 1e3, "ft"), Stream("/joints", "joint", 100.0, ""))
    run = write_files(tmp_path / "my arm.yaml", *streams, found, {})
    assert f"start it with `hc run '{run}'`" in run.read_text()
