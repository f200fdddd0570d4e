"""Decisions as networks read them: only the frontiers that exist, one after the other, and whose they are.

Slots that hold no frontier cost nothing this way, and a batch can be cut into minibatches without reading it
again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch
from torch import Tensor, nn

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.agents.rl.pooled import FEW
from layoutexplore.envs.egocentric_maps import CHANNELS, LAYOUT_CHANNELS
from layoutexplore.envs.observation import FRONTIER_FEATURES


class FrontierBatch(NamedTuple):
    """A batch of decisions.

    Attributes:
        frontiers: float32 (n, columns), the frontiers of all decisions, those of the first one first.
        counts: int64 (batch,), how many each decision has.
        owners: int64 (n,), whose each is.
        places: int64 (n,), its slot.
        robot: float32 (batch, entries).
        maps: float32 or uint8 (batch, channels, rows, cols), or None.
        privileged: float32 (batch, entries), compressed, or None.
        slots: How many slots there are.
    """

    frontiers: Tensor
    counts: Tensor
    owners: Tensor
    places: Tensor
    robot: Tensor
    maps: Tensor | None
    privileged: Tensor | None
    slots: int

    def take(self, chosen: Tensor) -> FrontierBatch:
        """Some of the decisions, int64 (k,), in that order."""
        counts = self.counts[chosen]
        owners = torch.repeat_interleave(torch.arange(len(chosen), device=counts.device), counts)
        shift = (torch.cumsum(self.counts, 0) - self.counts)[chosen] - (torch.cumsum(counts, 0) - counts)
        rows = torch.arange(len(owners), device=counts.device) + shift[owners]
        maps = None if self.maps is None else self.maps[chosen]
        privileged = None if self.privileged is None else self.privileged[chosen]
        return FrontierBatch(
            self.frontiers[rows],
            counts,
            owners,
            self.places[rows],
            self.robot[chosen],
            maps,
            privileged,
            self.slots,
        )

    def in_slots(self, values: Tensor) -> Tensor:
        """A value of each frontier (n,) at its slot, 0 at empty ones: (batch, slots)."""
        table = values.new_full((len(self.counts), self.slots), 0.0)
        return table.index_put((self.owners, self.places), values)


class Reader(nn.Module):
    """Takes what the policy reads out of an observation, by name.

    Lengths and areas are compressed by asinh, which keeps small ones as they are and needs no statistics.
    """

    def __init__(self, spec: PolicySpec) -> None:
        super().__init__()
        self._columns = spec.frontier_columns
        self._robot = spec.robot_columns
        self._rank = spec.rank_column
        channels = CHANNELS + LAYOUT_CHANNELS
        self._channels = [channels.index(name) for name in spec.map_channels]

    def forward(self, observation: Mapping[str, Tensor]) -> FrontierBatch:
        """The decisions of a batch of observations."""
        table = observation["frontiers"]
        table = table.reshape(len(table), -1, len(FRONTIER_FEATURES))
        valid = table[..., list(FRONTIER_FEATURES).index("valid")] > 0
        owners, places = valid.nonzero(as_tuple=True)
        chosen = table[owners, places][:, self._columns]
        frontiers = torch.asinh(chosen)
        if self._rank is not None:
            frontiers[:, self._rank] = chosen[:, self._rank]
        counts = valid.sum(dim=1)
        robot = torch.asinh(observation["robot"][:, self._robot])
        robot = torch.cat([robot, torch.log1p(counts[:, None] / FEW)], dim=1)
        maps = observation["global_map"][:, self._channels] if self._channels else None
        hidden = observation.get("privileged")
        hidden = None if hidden is None else torch.asinh(hidden)
        return FrontierBatch(frontiers, counts, owners, places, robot, maps, hidden, valid.shape[1])
