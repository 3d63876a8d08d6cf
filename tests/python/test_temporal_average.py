"""Tests the prototype of the temporal finish: less noise where nothing changes, no ghosts of moving caustics."""

import unittest
import unittest.mock

import numpy as np

import support  # noqa: F401

from lab import temporal_average

SHAPE = (24, 64)
FRAMES, MIDDLE = 5, 2


def match(frame, other):
    """A still camera before things that do not move."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return rows, columns, np.ones(SHAPE, bool)


class Average(unittest.TestCase):
    def setUp(self):
        self.random = np.random.default_rng(3)

    def estimates(self, truth, sigma):
        """Frames with independent noise of a known size."""
        variance = np.full((*SHAPE, 3), sigma**2)
        return [
            temporal_average.Estimate.of(one[..., None] + sigma * self.random.standard_normal(variance.shape), variance)
            for one in truth
        ]

    def caustic(self, height, width, speed):
        """A bright line that moves across the floor."""
        columns = np.broadcast_to(np.arange(SHAPE[1]), SHAPE)
        moments = np.arange(FRAMES) - MIDDLE
        return [height * np.exp(-np.square((columns - 28 - speed * moment) / width) / 2) for moment in moments]

    def largest_bias(self, height, width, speed, rounds=12):
        """The largest bias of the averaged middle frame in any column, in standard errors of its own estimate."""
        truth = self.caustic(height, width, speed)
        means = [temporal_average.average(self.estimates(truth, 1.0), MIDDLE, match)[0] for _ in range(rounds)]
        return np.abs(np.mean(means, (0, 1, 3)) - truth[MIDDLE][0]).max()

    def test_four_equal_neighbours_leave_little_more_than_a_fifth_of_the_variance(self):
        picture, variance = temporal_average.average(self.estimates([np.ones(SHAPE)] * FRAMES, 0.1), MIDDLE, match)
        self.assertLess(np.square(picture - 1).mean(), 0.3 * 0.01)
        self.assertLess(variance.mean(), 0.3 * 0.01)

    def test_no_ghost_of_a_moving_caustic_is_above_one_standard_error(self):
        """Means of 12 pictures, 24 rows and 3 channels have standard errors of at most 0.04; the limit adds three."""
        for width, speed in ((0.7, 3), (2, 2), (6, 4)):
            for height in (1, 4, 8, 32):
                with self.subTest(width=width, speed=speed, height=height):
                    self.assertLess(self.largest_bias(height, width, speed), 1.12)

    def test_neighbours_without_a_test_leave_ghosts(self):
        """A planted fault: differences of the true values count as noise."""
        with unittest.mock.patch.object(temporal_average, "squared_bias", lambda *_: 0.0):
            self.assertGreater(self.largest_bias(8, 2, 2), 2)

    def test_ghosts_vanish_with_the_noise(self):
        truth = self.caustic(1.0, 2, 2)
        moved = np.abs(truth[MIDDLE] - truth[MIDDLE + 1]) > 0.05
        picture, _ = temporal_average.average(self.estimates(truth, 1e-4), MIDDLE, match)
        self.assertLess(np.abs(picture - truth[MIDDLE][..., None])[moved].max(), 1e-3)

    def test_hidden_pixels_and_holes_do_not_count(self):
        estimates = self.estimates([np.ones(SHAPE)] * FRAMES, 0.1)
        estimates[3].picture[5, 5] = np.nan

        def hidden(frame, other):
            rows, columns, seen = match(frame, other)
            seen[:, 40:] = False
            return rows, columns, seen

        picture, _ = temporal_average.average(estimates, MIDDLE, hidden)
        self.assertTrue(np.isfinite(picture).all())
        np.testing.assert_allclose(picture[:, 40:], estimates[MIDDLE].picture[:, 40:])
