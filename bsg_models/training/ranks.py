"""Coordinate the processes of one training, each of which takes a share of every batch.

`torchrun` starts the processes. One of them leads: only it validates, calibrates and writes. The
others compute the gradient of their share. All gradients are added up (by gloo on CPUs, by NCCL on
GPUs), weighted so that the sum is the gradient of the whole batch.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import distributed, nn

from bsg_models.errors import TrainingError
from bsg_models.zoo.settings import Device


@dataclass(frozen=True, slots=True)
class Ranks:
    """This process among those of a training."""

    number: int = 0  # of this process; 0 leads
    size: int = 1  # number of processes

    @property
    def leads(self) -> bool:
        """Whether it validates and writes."""
        return self.number == 0

    def add(self, values: torch.Tensor) -> torch.Tensor:
        """Return the sum of a tensor over all processes, the same in each of them."""
        if self.size > 1:
            distributed.all_reduce(values)
        return values

    def add_gradients(self, model: nn.Module) -> None:
        """Replace the gradients of a model by their sums over all processes."""
        if self.size == 1:
            return
        gradients = [one.grad for one in model.parameters() if one.grad is not None]
        every = self.add(torch.cat([one.flatten() for one in gradients]))
        parts = every.split_with_sizes([one.numel() for one in gradients])
        for gradient, part in zip(gradients, parts, strict=True):
            gradient.copy_(part.view_as(gradient))

    def wait(self) -> None:
        """Wait until all processes are here."""
        if self.size > 1:
            distributed.barrier()


@contextmanager
def join_ranks(device: torch.device) -> Iterator[Ranks]:
    """Join the processes that torchrun started.

    Without torchrun, or in the training of an ensemble's member, this process is alone.
    """
    if distributed.is_initialized() or not distributed.is_torchelastic_launched():
        yield Ranks()
        return
    if device.type == "cuda":
        torch.cuda.set_device(device)
    distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
    try:
        yield Ranks(distributed.get_rank(), distributed.get_world_size())
    finally:
        distributed.destroy_process_group()


def leads_training() -> bool:
    """Return whether this process writes the files and messages of its training."""
    return not distributed.is_torchelastic_launched() or os.environ.get("RANK", "0") == "0"


def find_device(wanted: Device) -> torch.device:
    """Return the device of a training.

    Args:
        wanted: `auto` for a GPU if there is one.
    """
    there = torch.cuda.is_available()
    if wanted == "cuda" and not there:
        raise TrainingError(
            "training.device is cuda, but torch finds no GPU here; use `--set training.device=cpu`"
            ", or install a torch that is built for this machine's GPU"
        )
    if wanted == "cpu" or not there:
        return torch.device("cpu")
    return torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
