"""A grid of elites: the best controller seen in each cell of behaviours.

MAP-Elites (Mouret and Clune 2015) keeps, of all controllers whose behaviour falls into
a cell, the one that is worth most. New ones are bred from those by the line operator
of Vassiliades and Mouret (2018), whose steps shrink along directions in which elites
agree. All state is plain arrays in the order in which cells were first filled, so that
a search that is resumed goes on to the same bytes.
"""

from collections.abc import Mapping

import numpy as np

from bns.errors import BnsError, FormatError

ISO, LINE = 0.03, 0.2
"""standard deviations of the line operator, as shares of a gene's range; on the
hexapod's gaits the best of those tried"""


class Archive:
    """Elites of a grid.

    Args:
        size: numbers of a controller, D.
        dimensions: of a behaviour, B.
        bins: cells along each of them.

    Attributes:
        genes: of the elites, each from 0 to 1, ``(N, D)``.
        behaviours: theirs, each from 0 to 1, ``(N, B)``.
        worth: theirs, higher is better, ``(N,)``.
    """

    def __init__(self, size: int, dimensions: int, bins: int):
        if bins < 1 or dimensions < 1 or bins**dimensions > 2**62:
            raise BnsError(
                f"A grid of {bins} bins along {dimensions} dimensions cannot be: give "
                "at least one of each, and fewer cells."
            )
        self.bins = bins
        self.genes = np.empty((0, size))
        self.behaviours = np.empty((0, dimensions))
        self.worth = np.empty(0)
        self._rows: dict[int, int] = {}

    def __len__(self) -> int:
        return len(self.worth)

    @property
    def quality(self) -> float:
        """Worth of all elites together (QD score), less than nothing counted as 0."""
        return float(self.worth.clip(min=0.0).sum())

    def cells(self, behaviours: np.ndarray) -> np.ndarray:
        """Number of the cell of each behaviour ``(N, B)``, ``(N,)``."""
        steps = (behaviours * self.bins).astype(np.int64).clip(0, self.bins - 1)
        weights = self.bins ** np.arange(steps.shape[1], dtype=np.int64)
        found: np.ndarray = steps @ weights
        return found

    def add(
        self, genes: np.ndarray, behaviours: np.ndarray, worth: np.ndarray
    ) -> np.ndarray:
        """Keep those that are the best of their cells so far, one after another.

        Args:
            genes: ``(N, D)``.
            behaviours: ``(N, B)``; one that is not finite is left out.
            worth: ``(N,)``; one that is not finite is left out.

        Returns:
            Which were kept at their turn, ``(N,)`` bool.
        """
        good = np.isfinite(worth) & np.isfinite(behaviours).all(1)
        cells = self.cells(np.nan_to_num(behaviours))
        kept = np.zeros(len(worth), bool)
        fresh: list[np.intp] = []
        new: dict[int, int] = {}
        best = self.worth.copy()
        for index in np.flatnonzero(good):
            cell, value = int(cells[index]), float(worth[index])
            if cell in self._rows:
                row = self._rows[cell]
                if value > best[row]:
                    best[row], kept[index] = value, True
                    self.genes[row], self.behaviours[row] = (
                        genes[index],
                        behaviours[index],
                    )
            elif cell not in new:
                new[cell], kept[index] = len(fresh), True
                fresh.append(index)
            elif value > worth[fresh[new[cell]]]:
                fresh[new[cell]], kept[index] = index, True
        for cell, place in new.items():
            self._rows[cell] = len(best) + place
        self.genes = np.concatenate([self.genes, genes[fresh]])
        self.behaviours = np.concatenate([self.behaviours, behaviours[fresh]])
        self.worth = np.concatenate([best, worth[fresh]])
        return kept

    def bred(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Children of elites drawn at random, ``(count, D)``.

        Args:
            count: how many.
            rng: the only source of randomness.
        """
        one, other = rng.integers(len(self), size=(2, count))
        parents = self.genes[one]
        noise = ISO * rng.standard_normal(parents.shape)
        along = LINE * rng.standard_normal((count, 1))
        children: np.ndarray = parents + noise + along * (self.genes[other] - parents)
        return children.clip(0.0, 1.0)

    def state(self) -> dict[str, np.ndarray]:
        """All of it as plain arrays.

        Returns:
            name -> array: genes ``(N, D)``, behaviours ``(N, B)``, worth ``(N,)``.
        """
        return {
            "genes": self.genes.copy(),
            "behaviours": self.behaviours.copy(),
            "worth": self.worth.copy(),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from `state`.

        Raises:
            FormatError: elites that share a cell, or whose numbers disagree.
        """
        genes, behaviours, worth = (
            np.array(arrays[name], np.float64) for name in self.state()
        )
        shapes = (genes.shape[1:], behaviours.shape[1:], genes.shape[:1])
        own = (self.genes.shape[1:], self.behaviours.shape[1:], worth.shape)
        cells = self.cells(behaviours) if shapes == own else np.zeros(2)
        if len(set(cells.tolist())) != len(worth) or len(behaviours) != len(worth):
            raise FormatError("These arrays are no grid of elites: cells or shapes.")
        self.genes, self.behaviours, self.worth = genes, behaviours, worth
        self._rows = {int(cell): row for row, cell in enumerate(cells)}
