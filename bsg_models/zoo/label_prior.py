"""Common sense about room labels, as a prior of what rooms hold.

Few buildings have a laundry room, and a table written down by hand knows what one holds
(`bsg_models.zoo.prior_table`). It changes the odds that a room holds any of class c, and not how
many it holds if it does:

    log odds of at least one  +=  f · trust_c · (logit P(c | label) − logit P(c | any room))

f is the share that the room hides: where a robot has looked, objects say more than the label. The
network learns how far to trust the table, and what it knows better of labels that occur often.
"""

from __future__ import annotations

import numpy as np
import torch
from scipy.special import logit
from torch import nn

from bsg_data.scene.room_label import list_room_labels
from bsg_models.zoo.prior_table import read_prior_table

_TRUST = 0.5  # at the start


class LabelPrior(nn.Module):
    """What common sense adds to the log odds of a class in a room with a label."""

    log_odds: torch.Tensor  # [L, C] minus those of any room; 0 for labels that are not listed

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.register_buffer("log_odds", torch.zeros(len(list_room_labels()), classes))
        self.trust = nn.Parameter(torch.full((classes,), _TRUST))

    def read_table(self, classes: tuple[str, ...]) -> None:
        """Read the shipped table."""
        presence, weight = read_prior_table("", classes).list_types(classes)
        log_odds = logit(presence) - logit(weight @ presence)
        self.log_odds.copy_(torch.from_numpy(np.where(weight[:, None] > 0, log_odds, 0.0)))

    def forward(self, labels: torch.Tensor) -> torch.Tensor:
        """Return what f = 1 adds `[N, C]`, given P(label) `[N, L]`; 0 where it is unknown."""
        added: torch.Tensor = labels @ self.log_odds * self.trust
        return added
