"""Tests of the wheel: python -m unittest discover -s services/planner/harmonic/python/tests"""

import contextlib
import io
import os
import re
import subprocess
import tempfile
import threading
import unittest
from pathlib import Path

import numpy as np
from harmonic_field import SolveError, solve


def hall():
    """10 rows and 20 columns, a wall with a door in its last row, and a cell that is cut off."""
    free = np.ones((10, 20), bool)
    free[:9, 10] = False
    free[0:2, 1], free[1, 0] = False, False
    return free


def residuals(field, free):
    """What is left of the five-point equation in each free cell but the target, relative to u."""
    u = np.pad(field.u, 1)
    mean = (u[:-2, 1:-1] + u[2:, 1:-1] + u[1:-1, :-2] + u[1:-1, 2:]) / 4
    inner = free & (field.u > 0)
    inner[field.target] = False
    return np.abs(field.u - mean)[inner] / field.u[inner]


class Fields(unittest.TestCase):
    def test_the_field_fulfils_its_equation_in_the_order_of_numpy(self):
        free = hall()
        field = solve(free, (2, 17))
        self.assertEqual((field.shape, field.target, field.u[2, 17]), ((10, 20), (2, 17), 1))
        self.assertTrue((field.u[~free] == 0).all() and field.u[0, 0] == 0)
        worst = residuals(field, free).max()
        self.assertLessEqual(worst, 2e-5)
        self.assertAlmostEqual(worst, field.verification.worst_residual, delta=1e-6)
        self.assertEqual(field.verification.reachable, np.count_nonzero(field.u))
        with np.errstate(divide="ignore"):
            np.testing.assert_allclose(field.log10_u, np.log10(field.u), rtol=1e-12)
        # A view with other strides is the same map.
        turned = solve(free.T, (17, 2))
        np.testing.assert_allclose(turned.u, field.u.T, rtol=1e-4)

    def test_directions_are_unit_vectors_and_those_of_positions(self):
        field = solve(hall(), (2, 17))
        directions = field.directions()
        lengths = np.linalg.norm(directions, axis=2)
        reachable = field.u > 0
        reachable[field.target] = False
        np.testing.assert_allclose(lengths[reachable], 1, atol=1e-12)
        self.assertFalse(lengths[~reachable].any())
        np.testing.assert_allclose(field.direction(5, 8), directions[8, 5], atol=1e-9)
        self.assertGreater(field.direction(14, 2)[0], 0.9)
        self.assertIsNone(field.direction(17, 2))
        self.assertEqual(field.guidance(0, 0), ("unreachable", None))
        self.assertEqual(field.guidance(10, 3)[0], "way_out")

    def test_a_path_ends_at_the_target_through_free_cells(self):
        free = hall()
        field = solve(free, (2, 17))
        path = field.path((5, 2))
        self.assertEqual((*path[0], *path[-1]), (2, 5, 17, 2))
        columns, rows = path.round().astype(int).T
        self.assertTrue(free[rows, columns].all())
        self.assertLess(np.linalg.norm(np.diff(path, axis=0), axis=1).max(), 1.5)
        with self.assertRaisesRegex(SolveError, "no path leads from .row 0, column 0."):
            field.path((0, 0))

    def test_an_update_gives_the_field_of_the_changed_map_and_a_refused_one_changes_nothing(self):
        free = hall()
        field = solve(free, (2, 17), screening=8)
        before = field.u
        with self.assertRaisesRegex(SolveError, "target .column 17, row 2. is blocked"):
            field.update({(4, 4): False, (2, 17): False})
        np.testing.assert_array_equal(field.u, before)
        field.update({(4, 10): True, (9, 10): False})
        free[4, 10], free[9, 10] = True, False
        np.testing.assert_allclose(field.u, solve(free, (2, 17), screening=8).u, rtol=1e-3)

    def test_what_is_wrong_is_said(self):
        free = hall()
        for target, said in [((0, 10), "target .column 10, row 0. is blocked"), ((10, 0), "outside the map of 20 x 10")]:
            with self.assertRaisesRegex(SolveError, said):
                solve(free, target)
        with self.assertRaisesRegex(SolveError, "screening length"):
            solve(free, (2, 17), screening=0)
        for other in [free.astype(np.int8), free[0], free.tolist()]:
            with self.assertRaisesRegex(TypeError, "two-dimensional NumPy array of bool"):
                solve(other, (2, 17))

    def test_the_example_of_the_readme_says_what_its_comment_says(self):
        readme = (Path(__file__).parents[2] / "README.md").read_text()
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(re.search("```python\n(.*?)```", readme, re.DOTALL)[1], {})
        self.assertTrue(said.getvalue().startswith("(0.9"), said.getvalue())
        self.assertTrue(said.getvalue().endswith("[17.  5.]\n"), said.getvalue())

    @unittest.skipUnless("FIRSTHAND" in os.environ, "FIRSTHAND names no executable to compare with")
    def test_u_is_that_of_firsthand_field(self):
        free = np.pad(hall(), 1)
        with tempfile.TemporaryDirectory() as work:
            rows = "\n".join("".join("@."[cell] for cell in row) for row in free.astype(int))
            Path(work, "hall.map").write_text(f"type octile\nheight {len(free)}\nwidth {len(free[0])}\nmap\n{rows}\n")
            command = [os.environ["FIRSTHAND"], "field", "hall.map", "--target-cell", "18,3", "--out", "hall.npy"]
            subprocess.run(command, cwd=work, check=True, capture_output=True)
            values = np.load(f"{work}/hall.npy")
        field = solve(free, (3, 18))
        np.testing.assert_array_equal(field.u, np.ldexp(values["mantissa"], values["exponent"]))
        np.testing.assert_allclose(field.directions()[2, 3], [values["ex"][2, 3], values["ey"][2, 3]], atol=1e-6)

    def test_u_has_its_full_range_and_other_threads_run_while_it_is_solved(self):
        free = np.ones((801, 2001), bool)
        free[1::2] = False
        free[1::4, -1], free[3::4, 0] = True, True
        solved = []
        thread = threading.Thread(target=lambda: solved.append(solve(free, (0, 0))))
        thread.start()
        turns = 0
        while thread.is_alive():
            turns += 1
        thread.join()
        self.assertLess(solved[0].log10_u[800].max(), -100_000)
        self.assertEqual(solved[0].u[800].max(), 0)
        self.assertGreater(turns, 1000)


if __name__ == "__main__":
    unittest.main()
