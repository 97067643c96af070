"""The pillar network: points of a pillar to features, a picture of pillars to centres."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn
from torch.nn import functional

from smartmot.lidar.learned.decoding import CHANNELS, Decoder
from smartmot.lidar.learned.pillars import FEATURES

if TYPE_CHECKING:
    from evaluation.studies.training.samples import Targets

PILLAR, WIDTHS, BLOCKS, JOINED, HEAD = 24, (32, 48, 96), (1, 2, 3), 16, 32
"""Features of a pillar; channels and further convolutions at half, a quarter and an eighth of the grid;
channels of each of the three where they are joined, and of the head: as many as 25 ms of one thread allow."""

PRIOR = 0.01
"""Score of a cell at the start of training: next to all hold no centre (Lin et al., "Focal loss", 2017)."""

WEIGHTS = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.2, 0.2)
"""Of `CHANNELS` in the loss; the direction counts less than the axis, which decides the overlap."""


def _convolution(channels_in: int, channels: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(channels_in, channels, 3, stride, 1, bias=False), nn.BatchNorm2d(channels), nn.ReLU()
    )


class PillarNetwork(nn.Module):
    """See the module; the output is described by `smartmot.lidar.learned.Decoder`."""

    def __init__(self, decoder: Decoder) -> None:
        super().__init__()
        self.shape = decoder.grid.shape
        self.classes = len(decoder.classes)
        self.of_points = nn.Sequential(
            nn.Linear(len(FEATURES), PILLAR), nn.ReLU(), nn.Linear(PILLAR, PILLAR), nn.ReLU()
        )
        before = PILLAR
        self.blocks, self.side = nn.ModuleList(), nn.ModuleList()
        for width, further in zip(WIDTHS, BLOCKS, strict=True):
            layers = [_convolution(before, width, 2), *(_convolution(width, width) for _ in range(further))]
            self.blocks.append(nn.Sequential(*layers))
            self.side.append(
                nn.Sequential(nn.Conv2d(width, JOINED, 1, bias=False), nn.BatchNorm2d(JOINED), nn.ReLU())
            )
            before = width
        self.head = _convolution(JOINED * len(WIDTHS), HEAD)
        self.scores = nn.Conv2d(HEAD, self.classes, 1)
        self.values = nn.Conv2d(HEAD, len(CHANNELS), 1)
        nn.init.constant_(self.scores.bias, -math.log(1.0 / PRIOR - 1.0))

    def forward(
        self, features: Tensor, cell: Tensor, frames: int = 1, shape: tuple[int, int] | None = None
    ) -> Tensor:
        """(B, C, R, L) output of B frames' pillars: (N, M, F) features and (N,) cells, frame after frame.

        `shape`: cells ahead and to the left of a frame; None: those of the decoder.
        """
        pillar = self._of_own_points(features) if self.training else self.of_points(features).amax(1)
        rows, columns = shape or self.shape
        picture = pillar.new_zeros((frames * rows * columns, PILLAR)).index_copy(0, cell, pillar)
        at = picture.reshape(frames, rows, columns, PILLAR).permute(0, 3, 1, 2)
        joined = []
        for number, (block, side) in enumerate(zip(self.blocks, self.side, strict=True)):
            at = block(at)
            level = side(at)
            joined.append(functional.interpolate(level, scale_factor=float(2**number)) if number else level)
        head = self.head(torch.cat(joined, 1))
        return torch.cat((self.scores(head), self.values(head)), 1)

    def _of_own_points(self, features: Tensor) -> Tensor:
        """(N, P) features of pillars without what fills those with few points, two thirds of all.

        A graph in a file has as many points of each.
        """
        own = torch.ones(features.shape[:2], dtype=torch.bool)
        own[:, 1:] = (features[:, 1:] != features[:, :1]).any(2)
        return torch.segment_reduce(self.of_points(features[own]), "max", lengths=own.sum(1), unsafe=True)


def loss_of(output: Tensor, wanted: Targets, classes: int) -> tuple[Tensor, Tensor]:
    """Losses of scores and of boxes, each per centre.

    Focal loss with penalties reduced around centres (Law, Deng, "CornerNet", 2018), and absolute differences.
    """
    heat = torch.from_numpy(wanted.heat)
    logits = output[:, :classes]
    score = logits.sigmoid().clamp(1e-5, 1.0 - 1e-5)
    is_centre = heat == 1.0
    centres = max(int(is_centre.sum()), 1)
    at_centres = (1.0 - score) ** 2 * score.log()
    elsewhere = (1.0 - heat) ** 4 * score**2 * (1.0 - score).log() * ~torch.from_numpy(wanted.ignored)
    of_scores = -torch.where(is_centre, at_centres, elsewhere).sum() / centres
    values = output[:, classes:].permute(0, 2, 3, 1).reshape(-1, len(CHANNELS))
    difference = (values[torch.from_numpy(wanted.cell)] - torch.from_numpy(wanted.values)).abs()
    of_boxes = (difference * torch.tensor(WEIGHTS)).sum() / max(len(wanted.cell), 1)
    return of_scores, of_boxes
