"""One fine-tuning step in PyTorch: 8 frames of 1,500 points, each with weights of its own from the heads; loss,
gradients and Adam. "double backward" is how the paper's code does it; "by hand" writes the field's gradient as a sweep
of its own, which needs first-order autograd only."""

import torch
from torch import nn

from effigy_bench import arguments, bench, compare, timed

FRAMES, POINTS, OMEGA = 8, 1500, 30.0
CODE, WIDTH = 144, 256


class Head(nn.Module):
    """From a pose code to a layer's parameters; `rank` of them at a time, or all from the hidden layer."""

    def __init__(self, outputs, rank):
        super().__init__()
        self.trunk = nn.Sequential(
            nn.Linear(CODE, WIDTH), nn.LayerNorm(WIDTH), nn.ReLU(),
            nn.Linear(WIDTH, WIDTH), nn.LayerNorm(WIDTH), nn.ReLU(),
        )
        self.out = (
            nn.Sequential(nn.Linear(WIDTH, rank), nn.Linear(rank, outputs)) if rank else nn.Linear(WIDTH, outputs)
        )

    def forward(self, code):
        return self.out(self.trunk(code))


class Step:
    def __init__(self, hidden, layers, rank, by_hand):
        torch.manual_seed(1)
        sizes = [3] + [hidden] * (layers - 1) + [1]
        self.shapes = list(zip(sizes[1:], sizes[:-1]))
        self.meta, heads = [], []
        for number, (outputs, inputs) in enumerate(self.shapes):
            bound = 1 / inputs if number == 0 else (6 / inputs) ** 0.5 / OMEGA
            weight = torch.empty(outputs, inputs).uniform_(-bound, bound)
            self.meta.append((weight, torch.zeros(outputs)))
            heads.append(Head(outputs * inputs + outputs, rank))
        self.heads = nn.ModuleList(heads)
        with torch.no_grad():
            for parameter in self.heads.parameters():
                parameter.mul_(0.01)
        self.adam = torch.optim.Adam(self.heads.parameters(), lr=1e-6, fused=True)
        self.code = torch.rand(FRAMES, CODE) - 0.5
        self.points = torch.rand(FRAMES, POINTS, 3) * 2 - 1
        self.normals = nn.functional.normalize(self.points, dim=-1)
        self.by_hand = by_hand

    def layers(self):
        for (outputs, inputs), (weight, bias), head in zip(self.shapes, self.meta, self.heads):
            residual = head(self.code)
            cut = outputs * inputs
            yield weight + residual[:, :cut].view(-1, outputs, inputs), bias + residual[:, cut:]

    def field(self, layers, points):
        """Values, and what a sweep backwards needs of each layer."""
        x, kept = points, []
        for number, (weight, bias) in enumerate(layers):
            z = torch.baddbmm(bias.unsqueeze(1), x, weight.transpose(1, 2))
            if number + 1 == len(layers):
                return z.squeeze(-1), kept
            kept.append(OMEGA * z)
            x = torch.sin(kept[-1])

    def values_and_gradients(self):
        layers = list(self.layers())
        if not self.by_hand:
            points = self.points.clone().requires_grad_(True)
            values, _ = self.field(layers, points)
            (gradients,) = torch.autograd.grad(values.sum(), points, create_graph=True)
            return values, gradients
        values, kept = self.field(layers, self.points)
        sweep = layers[-1][0].expand(FRAMES, 1, -1)
        sweep = sweep.expand(FRAMES, POINTS, -1)
        for (weight, _), phase in zip(reversed(layers[:-1]), reversed(kept)):
            sweep = torch.bmm(sweep * (OMEGA * torch.cos(phase)), weight)
        return values, sweep

    def __call__(self):
        values, gradients = self.values_and_gradients()
        length = gradients.norm(dim=-1)
        half = POINTS // 2
        cosine = (gradients[:, :half] * self.normals[:, :half]).sum(-1) / length[:, :half]
        loss = (
            3000 * values[:, :half].abs().mean()
            + 100 * (1 - cosine).mean()
            + 100 * torch.exp(-100 * values[:, half:].abs()).mean()
            + 50 * (length - 1).abs().mean()
        )
        self.adam.zero_grad(set_to_none=True)
        loss.backward()
        self.adam.step()


def main():
    options = arguments(__doc__).parse_args()
    print(f"PyTorch {torch.__version__}, {torch.get_num_threads()} threads\n")
    peers = []
    for name, hidden, layers, rank, count in [("live", 128, 5, 32, 9), ("paper-size", 256, 7, None, 3)]:
        for how, by_hand in [("double backward", False), ("by hand", True)]:
            step = Step(hidden, layers, rank, by_hand)
            peers.append((f"PyTorch, {how}, {name}", f"fine-tuning step, {name}", timed(step, count)))
    compare(options.rounds, lambda: bench(options.effigy, "field"), peers)


if __name__ == "__main__":
    main()
