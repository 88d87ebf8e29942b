"""The processes of one training: `torchrun` starts several, and each takes a share of every batch.

One process leads: it alone validates, calibrates and writes. Each of the others computes the
gradient of its share; torch's `DistributedDataParallel` takes the mean of all (gloo on CPUs, NCCL
on GPUs), weighed so that it is the gradient of the whole batch.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import distributed

from bsg_data.arrays import Bools, Ints
from bsg_models.errors import TrainingError
from bsg_models.zoo.settings import Device


@dataclass(frozen=True, slots=True)
class Ranks:
    """This process among those of a training.

    Attributes:
        number: of this process, from 0, which leads.
        size: how many there are.
    """

    number: int = 0
    size: int = 1

    @property
    def leads(self) -> bool:
        """Whether it validates and writes."""
        return self.number == 0

    def takes(self, places: Ints, *, batch_size: int) -> Bools:
        """Return which places of an epoch are of this process, `[M]`: in each batch every size-th.

        Args:
            places: `[M]` of buildings in the order of the epoch, from 0.
            batch_size: buildings of a batch.
        """
        mine: Bools = (places % batch_size) % self.size == self.number
        return mine

    def share_of(self, batch_size: int) -> int:
        """Return how many buildings of a batch are of this process.

        Raises:
            TrainingError: if a process would have none.
        """
        if batch_size < self.size:
            raise TrainingError(
                f"training.batch_size {batch_size} cannot be dealt to {self.size} processes; start "
                "fewer by torchrun, or choose larger batches"
            )
        return -(-(batch_size - self.number) // self.size)

    def add(self, values: torch.Tensor) -> torch.Tensor:
        """Return the sum of a tensor over all processes, as each of them gets it."""
        if self.size > 1:
            distributed.all_reduce(values)
        return values

    def wait(self) -> None:
        """Wait until all processes are here."""
        if self.size > 1:
            distributed.barrier()


@contextmanager
def join_ranks(device: torch.device) -> Iterator[Ranks]:
    """Join the processes that torchrun started; without it there is this one alone."""
    if not distributed.is_torchelastic_launched():
        yield Ranks()
        return
    if distributed.is_initialized():  # a member of an ensemble
        yield Ranks(distributed.get_rank(), distributed.get_world_size())
        return
    if device.type == "cuda":
        torch.cuda.set_device(device)
    distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
    try:
        yield Ranks(distributed.get_rank(), distributed.get_world_size())
    finally:
        distributed.destroy_process_group()


def leads_training() -> bool:
    """Say whether this process is the one of its training that writes, and tells of it."""
    return not distributed.is_torchelastic_launched() or os.environ.get("RANK", "0") == "0"


def find_device(wanted: Device) -> torch.device:
    """Return what a training computes on.

    Args:
        wanted: `auto` for a GPU if there is one.

    Raises:
        TrainingError: if a GPU is wanted, and there is none.
    """
    there = torch.cuda.is_available()
    if wanted == "cuda" and not there:
        raise TrainingError(
            "training.device is cuda, and torch finds no GPU here; say `--set training.device=cpu`"
            ", or install a torch that is built for this machine's GPU"
        )
    if wanted == "cpu" or not there:
        return torch.device("cpu")
    return torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
