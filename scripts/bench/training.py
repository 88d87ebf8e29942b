"""Measure a training step with its data beside the same network in plain PyG.

Ours: an epoch on fresh masks, with all of its sampling, divided by its steps. Theirs: what a user
of PyG writes instead, with the same widths, batches, loss and optimiser: masks drawn object by
object, a `Data` a building, a `DataLoader`, `GCNConv` or `SAGEConv`. Its masks of `universal` are
simpler than ours. Their network alone takes the same steps on batches that are ready.
"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable, Iterator
from itertools import count, pairwise, permutations
from pathlib import Path

import numpy as np
import torch
from masks import build
from timing import Speed, time_both
from torch import nn
from torch.distributions import NegativeBinomial
from torch.nn.functional import dropout, mse_loss, relu, silu
from torch_geometric.data import Batch, Data
from torch_geometric.data import Dataset as GraphDataset
from torch_geometric.loader import DataLoader
from torch_geometric.nn import GCNConv, SAGEConv, global_add_pool

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.recipes import SplitRecipe
from bsg_models.belief.count_distribution import MIN_RATE
from bsg_models.inputs.nodes import EVIDENCE, list_edges
from bsg_models.training.buildings import TrainingBuildings
from bsg_models.training.count_gradients import CountGradients, as_network
from bsg_models.training.epochs import GradientSteps
from bsg_models.training.training import new_model
from bsg_models.zoo.config import RunConfig, find_config
from bsg_models.zoo.model import one_thread
from bsg_models.zoo.network import Network

REPEATS = 7
FASTER, LONGER = 5, 2  # times as fast as theirs with data, times as long as their network alone


def measure(hm3d: Path | None) -> Iterator[Speed]:
    """Yield what a step of each network takes, beside theirs with data and without."""
    with tempfile.TemporaryDirectory() as folder, one_thread():
        path = build(Path(folder), hm3d).path
        split_dataset(path, SplitRecipe())
        data = Dataset.open(path)
        for name in ("ceci-gcn", "universal"):
            yield from measure_step(name, data)


def measure_step(name: str, data: Dataset) -> Iterator[Speed]:
    """Yield what a step of a network of the zoo takes, beside theirs."""
    config = find_config(name)
    model = as_network(new_model(config, data))
    assert model is not None
    model.fit(data, config.data)
    buildings = TrainingBuildings(config, data, vocabulary=model.vocabulary)
    steps = GradientSteps(model, config, device=torch.device("cpu"))
    theirs = PlainGCN(model) if name == "ceci-gcn" else PlainSAGE(model)
    graphs = HalfSeen(data) if name == "ceci-gcn" else Explored(data, model.vocabulary)
    require_alike(theirs, model, next(buildings.batches(1)))
    loader = DataLoader(graphs, batch_size=config.training.batch_size, shuffle=True)
    step = plain_step(theirs, config)
    epoch = count(1)
    ready = list(loader)

    def ours() -> None:
        steps.train_epoch(buildings, next(epoch))

    for against, batches, target in (
        ("the same network in plain PyG, masks drawn by a loop", loader, FASTER),
        ("that network alone, on batches that are ready", ready, LONGER),
    ):
        taken = time_both(ours, lambda every=batches: [step(one) for one in every], repeats=REPEATS)
        yield Speed(
            what=f"a training step with its data, `{name}`",
            against=against,
            ours_s=taken[0] / buildings.steps,
            theirs_s=taken[1] / len(loader),
            target=target,
            at_least=batches is loader,
            kind="use" if batches is loader else "bound",
        )


def plain_step(network: nn.Module, config: RunConfig) -> Callable[[Batch], None]:
    """Return what takes a step as a user of PyG writes it."""
    training = config.training
    choose = torch.optim.Adam if training.decay_as == "weight-decay" else torch.optim.AdamW
    optimiser = choose(network.parameters(), lr=training.learning_rate, weight_decay=training.decay)

    def step(batch: Batch) -> None:
        optimiser.zero_grad()
        network.loss(batch).backward()
        if training.clip is not None:
            nn.utils.clip_grad_norm_(network.parameters(), training.clip)
        optimiser.step()

    return step


class HalfSeen(GraphDataset):
    """The training buildings as stars, of whose objects half are hidden."""

    def __init__(self, data: Dataset) -> None:
        super().__init__()
        self.cells = [data.cells(scene) for scene in data.splits["train"]]
        self.objects = [
            np.argwhere(cells).repeat(cells[cells > 0], axis=0).tolist() for cells in self.cells
        ]

    def len(self) -> int:
        """Return the number of buildings."""
        return len(self.cells)

    def get(self, idx: int) -> Data:
        """Return a building under a new mask."""
        y = self.cells[idx].copy()
        y[0] = y.sum(axis=0)
        x, objects = y.copy(), self.objects[idx]
        for room, kind in random.sample(objects, len(objects) // 2):
            x[0, kind] -= 1
            if room:
                x[room, kind] -= 1
        rooms = torch.arange(1, len(x))
        star = torch.stack([rooms, torch.zeros_like(rooms)])
        return Data(
            x=torch.from_numpy(x).float(),
            y=torch.from_numpy(y).float(),
            edge_index=torch.cat([star, star.flip(0)], dim=1),
        )


class PlainGCN(nn.Module):
    """The paper's network."""

    def __init__(self, ours: Network) -> None:
        super().__init__()
        config, classes = ours.config, ours.inputs.classes
        widths = [classes, *[config.width] * (config.depth - 1), classes]
        self.convolutions = nn.ModuleList(GCNConv(a, b) for a, b in pairwise(widths))
        self.norms = nn.ModuleList(nn.BatchNorm1d(width) for width in widths[1:-1])
        self.dropout = config.dropout

    def forward(self, batch: Batch) -> torch.Tensor:
        """Return the predicted totals."""
        x = batch.x
        for convolution, norm in zip(self.convolutions, self.norms, strict=False):
            x = relu(norm(convolution(x, batch.edge_index)))
            x = dropout(x, self.dropout, self.training)
        return self.convolutions[-1](x, batch.edge_index)

    def loss(self, batch: Batch) -> torch.Tensor:
        """Return the mean squared error."""
        return mse_loss(self(batch), batch.y)


class Explored(GraphDataset):
    """The training buildings as a robot may have explored them."""

    def __init__(self, data: Dataset, vocabulary: tuple[str, ...]) -> None:
        super().__init__()
        self.classes, self.words = len(data.manifest.class_space.classes), len(vocabulary)
        self.buildings = [self.read(data, scene, vocabulary) for scene in data.splits["train"]]

    def read(self, data: Dataset, scene: str, vocabulary: tuple[str, ...]) -> tuple[list, ...]:
        """Return objects, other objects, neighbours and evidence of a building."""
        cells, unclassified = data.cells(scene), data.unclassified(scene)
        around = data.surroundings(scene)
        number = {word: place for place, word in enumerate(vocabulary)}
        columns = [number.get(word, -1) for word in unclassified.categories]
        neighbours = [[] for _ in cells]
        for a, b in data.connections(scene).pairs.tolist():
            neighbours[a].append(b)
            neighbours[b].append(a)
        evidence = np.hstack(
            [np.broadcast_to(e.encode(around), (len(cells), e.width)) for e in EVIDENCE.values()]
        )
        return (
            np.argwhere(cells).repeat(cells[cells > 0], axis=0).tolist(),
            [
                (room, columns[kind])
                for room, kind in np.argwhere(unclassified.cells).tolist()
                if columns[kind] >= 0
            ],
            neighbours,
            torch.from_numpy(evidence),
        )

    def len(self) -> int:
        """Return the number of buildings."""
        return len(self.buildings)

    def get(self, idx: int) -> Data:
        """Return a building under a new mask: rooms found on a walk, some of them entered."""
        objects, unclassified, neighbours, evidence = self.buildings[idx]
        rooms = list(range(1, len(neighbours)))
        found = self.walk(neighbours, random.choice(rooms)) if random.random() < 0.6 else rooms
        rows = {0: 0, **{room: row for row, room in enumerate(found, start=1)}}
        entered = set(random.sample(found, random.randint(0, len(found))))
        share = [0.0] * len(rows)
        for room in found:
            share[rows[room]] = random.choice([0.0, random.random()]) if room in entered else 1.0
        share[0] = sum(share) / len(found)
        known = random.random() if random.random() < 0.25 else 1.0
        withheld = np.zeros((len(rows), self.classes), dtype=np.float32)
        for kind in range(self.classes):
            if random.random() < 0.05 or random.random() > known:
                withheld[:, kind] = 1
        x, y = np.zeros((2, len(rows), self.classes), dtype=np.float32)
        for room, kind in objects:
            if room in rows:
                y[rows[room], kind] += 1
                if not withheld[0, kind] and random.random() >= share[rows[room]]:
                    x[rows[room], kind] += 1
        shown = np.zeros((len(rows), self.words), dtype=np.float32)
        for room, word in unclassified:
            if room in rows and random.random() >= share[rows[room]]:
                shown[rows[room], word] = shown[0, word] = 1
        x[0], y[0] = x.sum(axis=0), y.sum(axis=0)
        edges = list(permutations(range(1, len(rows)), 2))
        return Data(
            x=torch.from_numpy(x),
            y=torch.from_numpy(y),
            unclassified=torch.from_numpy(shown),
            hidden=torch.tensor(share).clamp(0.0, 1.0),
            visited=torch.tensor([1.0] + [float(room in entered) for room in found]),
            withheld=torch.from_numpy(withheld),
            evidence=evidence[list(rows)],
            is_room=torch.tensor([0.0] + [1.0] * len(found)),
            edge_index=torch.tensor(edges, dtype=torch.long).reshape(-1, 2).T.contiguous(),
        )

    def walk(self, neighbours: list[list[int]], room: int) -> list[int]:
        """Return the rooms found from a room on; their number is uniform in its logarithm."""
        found = [room]
        for _ in range(int(len(neighbours) ** random.random()) - 1):
            near = [b for a in found for b in neighbours[a] if b not in found]
            left = near or [b for b in range(1, len(neighbours)) if b not in found]
            if not left:
                break
            found.append(random.choice(left))
        return sorted(found)


class PlainSAGE(nn.Module):
    """The network of `universal`, its weights under the same names."""

    def __init__(self, ours: CountGradients) -> None:
        super().__init__()
        config, self.classes = ours.config, ours.inputs.classes
        width, out = config.width, config.components * self.classes
        features = ours.get_parameter("enter.1.weight").shape[1]
        self.features = nn.ModuleDict(
            {"embedding": nn.Linear(len(ours.vocabulary), config.embedding, bias=False)}
        )
        self.enter = nn.Sequential(nn.Dropout(config.dropout / 2), nn.Linear(features, width))
        self.convolutions = nn.ModuleList(SAGEConv(width, width) for _ in range(config.depth))
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(config.depth))
        self.head = nn.ModuleDict(
            {
                "mean": nn.Linear(width, out),
                "shape": nn.Linear(width, out),
                "weight": nn.Linear(width, out),
                "tilt": nn.Linear(width, config.tilted * out),
            }
        )
        table = ours.get_parameter("labels.log_odds")
        self.labels = nn.ParameterDict(
            {
                "log_odds": nn.Parameter(table.detach().clone(), requires_grad=False),
                "trust": nn.Parameter(torch.full((self.classes,), 0.5)),
            }
        )
        self.dropout, self.overlooked = config.dropout, config.category_dropout
        self.forgotten, self.known = config.forget, EVIDENCE["size"].width + len(table)

    def describe(self, batch: Batch) -> torch.Tensor:
        """Return the features of the nodes."""
        number, room = batch.batch, batch.is_room[:, None]
        unclassified = batch.unclassified
        if self.training:
            unclassified = unclassified * (torch.rand_like(unclassified) >= self.overlooked)
        seen, words = (batch.x > 0).float(), self.features["embedding"](unclassified)
        looked = torch.cat([1 - batch.withheld, torch.ones_like(words)], dim=1)
        looked = looked * batch.visited[:, None] * room
        shown = torch.cat([seen, words], dim=1) * looked
        around = global_add_pool(shown, number)[number] - shown
        siblings = global_add_pool(looked, number)[number] - looked
        whole = global_add_pool(batch.x * (1 - room), number)[number]
        rooms = global_add_pool(room, number)[number]
        parts = [
            *(batch.x.log1p(), seen, batch.x.sum(dim=1, keepdim=True).log1p()),
            batch.hidden.clamp(0.02, 0.98).logit()[:, None] / 2,
            *(batch.visited[:, None], batch.withheld, words, whole.log1p()),
            *(around / (siblings + 3), rooms.log1p(), 1 - room, batch.evidence),
        ]
        return torch.cat(parts, dim=1)

    def forward(self, batch: Batch) -> torch.Tensor:
        """Return the nodes' encodings."""
        h = silu(self.enter(self.describe(batch)))
        for convolution, norm in zip(self.convolutions, self.norms, strict=True):
            heard = silu(norm(convolution(h, batch.edge_index)))
            h = h + dropout(heard, self.dropout, self.training)
        return h

    def loss(self, batch: Batch) -> torch.Tensor:
        """Return the mean of −log P(hidden) of a tilted mixture of negative binomials."""
        if self.training:
            keep = torch.rand(len(batch.x), 1) >= self.forgotten
            own, building = batch.evidence.split(
                [self.known, batch.evidence.shape[1] - self.known], 1
            )
            batch = batch.clone().update({"evidence": torch.cat([own * keep, building], dim=1)})
        encoded = self(batch)

        def read(name: str) -> torch.Tensor:
            said = self.head[name](dropout(encoded, self.dropout, self.training))
            return said.view(len(encoded), -1, self.classes).transpose(0, 1)

        mean, shape = read("mean").clamp(-10, 5).exp(), read("shape").clamp(-5, 5).exp()
        weight = read("weight").log_softmax(dim=0)
        none, one = read("tilt").clamp(-5, 5).chunk(2)
        labels = batch.evidence[:, 2 : self.known]
        sense = labels @ self.labels["log_odds"] * self.labels["trust"]
        none = none - sense * batch.hidden[:, None]
        seen, share = batch.x, torch.where(batch.withheld > 0, 1.0, batch.hidden[:, None])
        dispersion = shape + seen
        rate = (share * dispersion / (shape / mean + 1 - share)).clamp(min=MIN_RATE)
        counts = NegativeBinomial(dispersion, logits=rate.log() - dispersion.log())
        tilts = none * (seen == 0) + one * (seen == 1), one * (seen == 0)
        hidden = (batch.y - seen).clamp(min=0)
        log_p, more = counts.log_prob(hidden), 1.0
        for number, tilt in enumerate(tilts):
            log_p = log_p + tilt * (hidden == number)
            first = counts.log_prob(torch.full_like(hidden, number)).exp()
            more = more + first * tilt.expm1()
        cells = torch.logsumexp(log_p - more.clamp(min=1e-30).log() + weight, dim=0)
        return -cells[batch.is_room > 0].mean()


def require_alike(theirs: nn.Module, ours: Network, masked: MaskedBuildings) -> None:
    """Require the same answers of both networks, with the same weights on the same buildings.

    Means over neighbours are not ours, which silent neighbours shrink, so there none is heard.
    """
    ours.eval()
    theirs.eval()
    nodes = ours.nodes_of(masked.seen, masked.targets)
    every = {name: one.clone() for name, one in ours.state_dict().items()}
    state = {name: one for name, one in every.items() if "calibration" not in name}
    batch = Data(x=nodes.x, y=nodes.y)
    if isinstance(theirs, PlainGCN):
        names = theirs.state_dict()
        theirs.load_state_dict(dict(zip(names, state.values(), strict=True)))
        batch.edge_index = torch.from_numpy(list_edges(masked.seen, ("up", "down")))
    else:
        seen = masked.seen
        deaf = {name: one * 0 if "lin_l" in name else one for name, one in state.items()}
        ours.load_state_dict(deaf, strict=False)
        theirs.load_state_dict(deaf)
        batch.update(
            {
                "batch": nodes.building,
                "unclassified": (nodes.unclassified > 0).float(),
                "hidden": nodes.hidden_share,
                "visited": nodes.visited.float(),
                "withheld": (nodes.share >= 1).float(),
                "evidence": torch.cat([nodes.evidence[name] for name in EVIDENCE], dim=1),
                "is_room": 1 - nodes.is_building.float(),
                "edge_index": torch.from_numpy(list_edges(seen, ("complete",))),
            }
        )
    with torch.no_grad():
        torch.testing.assert_close(theirs.loss(batch), ours.loss(nodes), rtol=1e-4, atol=0)
    ours.load_state_dict(state, strict=False)
    theirs.train()
