"""One training step of the paper's field in float64, by PyTorch's double backward.

Writes siren_step.json, which `avatar/tests/siren_step.rs` holds the fused kernel to:

    python3 -m venv venv && venv/bin/pip install torch==2.15.0
    venv/bin/python avatar/tests/reference/siren_step.py avatar/tests/reference/siren_step.json

Weights, points and normals come from a small generator that the test repeats, so that the file holds
only the loss and about SAMPLES evenly spaced entries of each gradient. Seed 1, no other input.
"""

import json
import math
import sys

import torch

HIDDEN, LAYERS, OMEGA, POINTS, SAMPLES = 256, 7, 30.0, 96, 256
torch.set_default_dtype(torch.float64)


class Generator:
    """A 32-bit linear congruential generator (Numerical Recipes); the top 24 bits are a float in [-1, 1)."""

    def __init__(self, seed):
        self.state = seed

    def next(self):
        self.state = (self.state * 1664525 + 1013904223) % 2**32
        return (self.state >> 8) / 2**23 - 1.0

    def tensor(self, *shape):
        return torch.tensor([self.next() for _ in range(math.prod(shape))]).reshape(shape)

    def scaled(self, bound, *shape):
        """Products in float32, as the test makes them."""
        product = self.tensor(*shape).float() * torch.tensor(bound, dtype=torch.float32)
        return product.double()


def sample(values):
    stride = max(1, len(values) // SAMPLES)
    return {"stride": stride, "values": values[::stride].tolist()}


def main(path):
    numbers = Generator(1)
    parameters = []
    for layer in range(LAYERS):
        inputs = 3 if layer == 0 else HIDDEN
        outputs = 1 if layer + 1 == LAYERS else HIDDEN
        weight_bound = 1 / 3 if layer == 0 else (6 / HIDDEN) ** 0.5 / OMEGA
        parameters.append(numbers.scaled(weight_bound, outputs, inputs).requires_grad_())
        parameters.append(numbers.scaled(1 / inputs**0.5, outputs).requires_grad_())
    points = numbers.scaled(1.0, POINTS, 3).requires_grad_()
    normals = numbers.scaled(1.0, POINTS, 3)
    normals = (normals / normals.norm(dim=1, keepdim=True)).float().double()
    is_surface = torch.arange(POINTS) % 2 == 0

    hidden = points
    for layer in range(LAYERS - 1):
        hidden = torch.sin(OMEGA * (hidden @ parameters[2 * layer].T + parameters[2 * layer + 1]))
    values = (hidden @ parameters[-2].T + parameters[-1])[:, 0]
    (gradients,) = torch.autograd.grad(values.sum(), points, create_graph=True)

    lengths = gradients.norm(dim=1)
    cosine = (gradients * normals).sum(1) / lengths
    zero = torch.zeros(())
    loss = (
        3000 * torch.where(is_surface, values.abs(), zero).mean()
        + 100 * torch.where(is_surface, zero, torch.exp(-100 * values.abs())).mean()
        + 100 * torch.where(is_surface, 1 - cosine, zero).mean()
        + 50 * (lengths - 1).abs().mean()
    )
    loss.backward()

    reference = {
        "torch": torch.__version__,
        "normals": normals.flatten().tolist(),
        "loss": loss.item(),
        "gradients": [sample(p.grad.flatten()) for p in parameters],
    }
    with open(path, "w") as file:
        json.dump(reference, file)


main(sys.argv[1])
