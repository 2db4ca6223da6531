"""Tests of the wheel on a simulated robot, which the executable that FIRSTHAND names drives: python -m unittest discover -s tests"""

import contextlib
import ctypes
import io
import itertools
import os
import re
import signal
import subprocess
import tempfile
import threading
import unittest
from pathlib import Path
from unittest import mock

import firsthand
import numpy as np
from firsthand import topics
from firsthand.samples import dtype_of

ROBOT = "ci-wheels"


def lines_of(page):
    """The first lines of Python on a page of the guide."""
    text = (Path(__file__).parents[2] / "guide" / page).read_text()
    return re.search("```python\n(.*?)```", text, re.DOTALL)[1]


def said_by(lines):
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(lines, {})
    return said.getvalue()


def setUpModule():
    global run, directory, follower, heard, whole, enough
    work = tempfile.TemporaryDirectory()
    directory = Path(work.name) / "run"
    heard, whole, here, enough = {}, firsthand.Map(), threading.Event(), threading.Event()

    def follow():
        for topic, sample in firsthand.follow(ROBOT, "pose", "grid", events=True):
            if topic == "pose":
                heard[sample.stamp.tick] = sample.x_m
                here.set()
                if len(heard) == 50:
                    enough.set()
            elif topic == "grid":
                whole.apply(sample)
            elif topic == "gone":
                return

    follower = threading.Thread(target=follow, daemon=True)
    follower.start()
    command = [os.environ["FIRSTHAND"], "run", "open-room", "--pace", "4", "--stay", "--set", "controller.speed_m_s=0.1", "--robot", ROBOT]
    run = subprocess.Popen([*command, "--out", directory], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    unittest.addModuleCleanup(work.cleanup)
    unittest.addModuleCleanup(end)
    if not here.wait(60):
        raise RuntimeError("no pose came in a minute")


def end():
    run.send_signal(signal.SIGINT)
    run.wait()
    follower.join(60)


class Live(unittest.TestCase):
    def test_poses_come_in_the_order_of_their_ticks(self):
        poses = [pose for pose, _ in zip(firsthand.follow(ROBOT, "pose"), range(5))]
        ticks = [pose.stamp.tick for pose in poses]
        self.assertEqual(ticks, list(range(ticks[0], ticks[0] + 5)))
        self.assertIn("heading_rad=", repr(poses[0]))
        self.assertIn("Metres in the mission frame", topics.Pose.__doc__)

    def test_a_grid_is_a_view_of_shared_memory_that_nobody_writes_and_two_are_held_at_most(self):
        grids = firsthand.follow(ROBOT, "grid")
        grid = next(sample for sample in grids if sample.elements.size)
        part = grid.header.part
        self.assertEqual(grid.elements.shape, (part.height, part.width))
        address = grid.elements.__array_interface__["data"][0]
        for line in Path("/proc/self/maps").read_text().splitlines():
            begin, stop = (int(place, 16) for place in line.split()[0].split("-"))
            if begin <= address < stop:
                self.assertIn("/dev/shm/", line)
                break
        else:
            self.fail("no memory is there")
        self.assertFalse(grid.elements.flags.writeable)
        copy = grid.copy()
        np.testing.assert_array_equal(copy.elements, grid.elements)
        self.assertFalse(np.shares_memory(copy.elements, grid.elements))
        held = [grid]
        with self.assertRaisesRegex(BufferError, "two arrays of grid are held"):
            held.extend(itertools.islice(grids, 50))
        self.assertEqual(len(held), 2)

    def test_the_lines_of_the_guide_show_a_robot(self):
        poses = itertools.islice(firsthand.follow(ROBOT, "pose"), 3)
        with mock.patch("firsthand.follow", return_value=poses):
            said = said_by(lines_of("attach.md").replace("x80", ROBOT))
        self.assertRegex(said, r"^<robot ci-wheels at .*>\n(\d+ -?[\d.e-]+ -?[\d.e-]+\n){3}$")

    def test_the_state_of_a_robot_is_told_and_without_one_those_that_run(self):
        state = firsthand.robot_state(ROBOT)
        self.assertEqual(list(state.stages), ["link", "dead-reckoning", "mapper", "planner", "controller"])
        self.assertEqual({stage.state for stage in state.stages.values()}, {topics.StageState.Running})
        self.assertLessEqual(abs(state.pose.x_m), 5)
        self.assertEqual(state.target.target.x_m, 4)
        self.assertIsInstance(state.action, topics.Action)
        self.assertRegex(repr(state), r"^<robot ci-wheels at [\d.]+ s; (drive|hold) .*; target 1 of 1: \(4.000, 0.000\) m; link running in generation 1;")
        with self.assertRaisesRegex(firsthand.NotRunning, "'nobody' is not running on this machine; running: .*ci-wheels") as raised:
            firsthand.robot_state("nobody")
        self.assertIn(ROBOT, raised.exception.robots)
        self.assertRaises(firsthand.NotRunning, firsthand.fix, "nobody", 0, 0, sd_m=0.1)

    def test_a_file_of_a_page_beside_the_robots_is_no_robot(self):
        file = next(Path(place) for place in topics.places() if (Path(place) / ROBOT).is_dir()) / "nobody.page-8080"
        file.touch()
        self.addCleanup(file.unlink)
        self.assertIn(ROBOT, firsthand.robots())
        self.assertNotIn(file.name, firsthand.robots())
        for name in ("nobody", file.name):
            self.assertRaises(firsthand.NotRunning, firsthand.robot_state, name)

    def test_a_fix_is_used_and_a_turn_published(self):
        poses = firsthand.follow(ROBOT, "pose")
        pose = next(poses)
        firsthand.fix(ROBOT, pose.x_m, pose.y_m, sd_m=0.1, heading_rad=pose.heading_rad, sd_rad=0.1)
        after = next(after for after in poses if after.fixes + after.fixes_refused > pose.fixes + pose.fixes_refused)
        self.assertEqual((after.fixes, after.fixes_refused), (pose.fixes + 1, pose.fixes_refused))
        self.assertRaises(ValueError, firsthand.fix, ROBOT, 0, 0, sd_m=0.1, heading_rad=1)
        turns = firsthand.follow(ROBOT, "turn", "pose")
        next(turns)
        firsthand.turn(ROBOT, 0.01, sd_rad=1)
        turned = next(sample for topic, sample in turns if topic == "turn")
        self.assertEqual((turned.sequence, turned.turn_rad, turned.variance_rad2), (1, 0.01, 1))

    def test_a_topic_that_does_not_exist_is_refused_with_the_one_that_is_meant(self):
        with self.assertRaisesRegex(ValueError, "did you mean 'pose'"):
            firsthand.follow(ROBOT, "poses")


    def test_a_robot_of_another_version_is_told(self):
        class Pose(topics.Struct):
            _fields_ = [*topics.Pose._fields_, ("more", ctypes.c_double)]
            type_name = topics.Pose.type_name

        with mock.patch.dict(topics.TOPICS, pose=(Pose, None)), self.assertRaisesRegex(TypeError, "another version of firsthand"):
            next(firsthand.follow(ROBOT, "pose"))


class Recorded(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        enough.wait(60)
        end()
        cls.recording = firsthand.recording(directory)

    def test_columns_are_what_was_followed(self):
        pose = self.recording["pose"]
        recorded = dict(zip(pose["stamp"]["tick"].tolist(), pose["x_m"].tolist()))
        self.assertGreaterEqual(len(heard), 50)
        self.assertEqual(heard, {tick: recorded.get(tick) for tick in heard})
        np.testing.assert_allclose(pose["t_s"], pose["stamp"]["stamp_ns"] / 1e9)
        self.assertEqual(self.recording.run["robot"], ROBOT)
        self.assertTrue(self.recording.is_complete)

    def test_the_lines_of_the_guide_show_a_recording(self):
        said = said_by(lines_of("recordings.md").replace("recording.mcap", str(directory / "recording.mcap")))
        self.assertRegex(said, r"^Recording\(target: ")

    def test_parts_of_a_grid_make_the_map_that_was_followed(self):
        again, compared = firsthand.Map(), 0
        for grid in self.recording["grid"]:
            # A keyframe for who comes late is the map that its parts have made.
            if grid.header.part.keyframe and again.version == grid.header.part.version:
                np.testing.assert_array_equal(again.cells, grid.elements)
                compared += 1
            again.apply(grid)
        self.assertGreater(compared, 0)
        self.assertEqual(again.version, whole.version)
        np.testing.assert_array_equal(again.cells, whole.cells)

    def test_every_topic_has_the_structs_of_live_samples(self):
        for topic, samples in self.recording.items():
            payload, element = topics.TOPICS[topic]
            columns = samples
            if element is not None:
                columns = samples.headers
                self.assertEqual(samples[-1].elements.dtype, dtype_of(element), topic)
            for name, (kind, _) in dtype_of(payload).fields.items():
                self.assertEqual(columns.dtype.fields[name][0], kind, f"{topic}.{name}")
        self.assertEqual(self.recording["roster"][-1].elements["stage"][0], b"link")

    def test_a_recording_that_was_cut_off_is_read_as_far_as_it_goes(self):
        whole = (directory / "recording.mcap").read_bytes()
        cut = directory / "cut.mcap"
        cut.write_bytes(whole[: len(whole) * 2 // 3])
        part = firsthand.recording(cut)
        self.assertFalse(part.is_complete)
        count = len(part["pose"])
        self.assertTrue(0 < count < len(self.recording["pose"]))
        np.testing.assert_array_equal(part["pose"]["x_m"], self.recording["pose"]["x_m"][:count])
        cut.write_bytes(b"no recording")
        self.assertRaises(Exception, firsthand.recording, cut)


if __name__ == "__main__":
    unittest.main()
