"""CosPlace, MixVPR, SALAD, BoQ, MegaLoc: official checkpoints load, and mean the same."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the extra 'learned' is not installed")

from tests.unit.techniques.networks import by_names, checkpoints  # noqa: E402
from tests.unit.techniques.networks.by_names import Checkpoint  # noqa: E402
from torch import Tensor, nn  # noqa: E402

from retraverse.errors import InputError  # noqa: E402
from retraverse.techniques.networks.boq import Attention, BoqNet, Encoder  # noqa: E402
from retraverse.techniques.networks.cosplace import CosPlaceNet  # noqa: E402
from retraverse.techniques.networks.dinov2 import DinoV2  # noqa: E402
from retraverse.techniques.networks.mixvpr import MixVprNet  # noqa: E402
from retraverse.techniques.networks.published import rename, unfilled  # noqa: E402
from retraverse.techniques.networks.resnet import ResNet  # noqa: E402
from retraverse.techniques.networks.salad import MegaLocNet, SaladNet, share_out  # noqa: E402

SMALL = (64, 2, 9)
"""Width, depth and grid of a DINOv2 for tests; two heads."""


def small_dino() -> DinoV2:
    return DinoV2(width=64, depth=2, heads=2, grid=9)


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    with torch.inference_mode():
        yield
    torch.set_num_threads(before)


def pictures(height: int, width: int, n: int = 2) -> Tensor:
    noise: Tensor = torch.randn((n, 3, height, width), generator=torch.Generator().manual_seed(3))
    return noise


def n_parameters(network: nn.Module) -> int:
    return sum(parameter.numel() for parameter in network.parameters())


# Sizes that others state: torchvision's tables of models, less classifier (513,000 or 2,049,000);
# VGG16's convolutions; DINOv2 ViT-B/14's 86,580,480 less the mask token's 768.
@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: ResNet(18), 11_689_512 - 513_000),
        (lambda: ResNet(50), 25_557_032 - 2_049_000),
        (lambda: ResNet(101), 44_549_160 - 2_049_000),
        (lambda: ResNet(152), 60_192_808 - 2_049_000),
        (lambda: CosPlaceNet("VGG16", 512).backbone, 14_714_688),
        (DinoV2, 86_580_480 - 768),
    ],
)
def test_sizes_that_others_state(make: Callable[[], nn.Module], expected: int) -> None:
    assert n_parameters(unfilled(make)) == expected


def test_sizes_in_the_papers() -> None:
    # MixVPR, table 2: 10.88 M parameters with 4096 dimensions. SALAD, table 3: 1.4 M on DINOv2.
    assert round(n_parameters(unfilled(MixVprNet)) / 1e6, 2) == 10.88
    assert round(n_parameters(unfilled(lambda: SaladNet().aggregator)) / 1e6, 1) == 1.4


@pytest.mark.parametrize(
    ("make", "shapes", "renames"),
    [
        (lambda: CosPlaceNet("ResNet18", 32), checkpoints.geo("ResNet18", 32), "backbone."),
        (lambda: CosPlaceNet("ResNet50", 2048), checkpoints.geo("ResNet50", 2048), "backbone."),
        (lambda: CosPlaceNet("ResNet101", 512), checkpoints.geo("ResNet101", 512), "backbone."),
        (lambda: CosPlaceNet("ResNet152", 64), checkpoints.geo("ResNet152", 64), "backbone."),
        (lambda: CosPlaceNet("VGG16", 512), checkpoints.geo("VGG16", 512), None),
        (MixVprNet, checkpoints.mixvpr(1024, 4), None),
        (lambda: MixVprNet(256, 2), checkpoints.mixvpr(256, 2), None),
        (lambda: MixVprNet(64, 2), checkpoints.mixvpr(64, 2), None),
        (SaladNet, checkpoints.salad(), None),
        (MegaLocNet, checkpoints.megaloc(), None),
        (lambda: BoqNet("resnet50", 16384), checkpoints.boq("resnet50"), "backbone.net."),
        (lambda: BoqNet("dinov2", 12288), checkpoints.boq("dinov2"), None),
    ],
)
def test_every_official_name_and_shape(
    make: Callable[[], nn.Module], shapes: checkpoints.Shapes, renames: str | None
) -> None:
    from retraverse.techniques.networks.resnet import SEQUENTIAL_NAMES

    pairs = [(renames + old, renames + new) for old, new in SEQUENTIAL_NAMES] if renames else []
    named = {rename(name, pairs): shape for name, shape in shapes.items()}
    own = {name: tuple(value.shape) for name, value in unfilled(make).state_dict().items()}
    unused = {name for name in named if name.endswith("mask_token")}
    assert {name: shape for name, shape in named.items() if name not in unused} == own


def _cosplace(backbone: str) -> tuple[nn.Module, dict[str, np.ndarray], Callable[..., Tensor]]:
    arrays = checkpoints.seeded(checkpoints.geo(backbone, 32))
    names = [f"backbone.{number}" for number in (0, 1, 4, 5, 6, 7)]

    def slow(c: Checkpoint, x: Tensor) -> Tensor:
        vgg = backbone == "VGG16"
        return by_names.geo(
            c, by_names.vgg16(c, "backbone", x) if vgg else by_names.resnet(c, names, x)
        )

    return unfilled(lambda: CosPlaceNet(backbone, 32)), arrays, slow


@pytest.mark.parametrize("backbone", ["ResNet18", "VGG16"])
def test_cosplace_from_its_checkpoint(backbone: str) -> None:
    network, arrays, slow = _cosplace(backbone)
    network.load_named(arrays)  # type: ignore[operator]
    x = pictures(64, 96)
    got = network.eval()(x)
    assert got.shape == (2, 32)
    torch.testing.assert_close(got.norm(dim=1), torch.ones(2))
    torch.testing.assert_close(got, slow(Checkpoint(arrays), x), rtol=1e-4, atol=1e-5)


def test_mixvpr_from_its_checkpoint() -> None:
    arrays = checkpoints.seeded(checkpoints.mixvpr(64, 2))
    network = unfilled(lambda: MixVprNet(64, 2))
    network.load_named(arrays)
    network.eval()
    c, x = Checkpoint(arrays), pictures(64, 64)
    names = [f"backbone.model.{name}" for name in ("conv1", "bn1", "layer1", "layer2", "layer3")]
    maps = by_names.resnet(c, names, x)
    largest = maps.abs().max()
    torch.testing.assert_close(
        network.backbone["model"](x) / largest, maps / largest, rtol=0, atol=1e-5
    )
    maps = pictures(20, 20, n=2).repeat(1, 342, 1, 1)[:, :1024]
    got = network.aggregator(maps)
    maps = maps.flatten(2)
    for layer in range(4):
        name = f"aggregator.mix.{layer}.mix"
        hidden = c.linear(f"{name}.1", c.layer_norm(f"{name}.0", maps, 1e-5)).clamp(min=0)
        maps = maps + c.linear(f"{name}.3", hidden)
    # Rows first here: the two projections commute but for the biases.
    rows = torch.einsum("rp,ncp->ncr", c["aggregator.row_proj.weight"], maps)
    expected = torch.einsum("oc,ncr->nor", c["aggregator.channel_proj.weight"], rows)
    spread = c["aggregator.row_proj.weight"].sum(1)
    expected = expected + c["aggregator.channel_proj.bias"][:, None] * spread
    expected = expected + c["aggregator.row_proj.bias"]
    torch.testing.assert_close(got, by_names.unit(expected.flatten(1)), rtol=1e-3, atol=1e-5)


def test_mixvpr_of_the_first_code_has_no_bias_in_its_rows() -> None:
    shapes = checkpoints.mixvpr(64, 2)
    arrays = {name: np.ones(shape, np.float32) for name, shape in shapes.items()}
    del arrays["aggregator.row_proj.bias"]
    network = unfilled(lambda: MixVprNet(64, 2))
    network.load_named(arrays)
    assert not network.aggregator.row_proj.bias.any()


def test_salad_from_its_checkpoint() -> None:
    arrays = checkpoints.seeded(checkpoints.salad(*SMALL))
    network = SaladNet(small_dino())
    network.load_named(arrays)
    c, x = Checkpoint(arrays), pictures(126, 126)
    tokens = by_names.dinov2(c, "backbone.model", x, heads=2)
    tokens = c.layer_norm("backbone.model.norm", tokens, 1e-6)
    got = network.eval()(x)
    assert got.shape == (2, 8448)
    torch.testing.assert_close(got, by_names.salad(c, "aggregator", tokens), rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("release", [checkpoints.megaloc, checkpoints.megaloc_safetensors])
def test_megaloc_from_its_checkpoints(release: Callable[..., checkpoints.Shapes]) -> None:
    dimension = 24
    arrays = checkpoints.seeded(release(*SMALL, dimension))
    network = MegaLocNet(small_dino(), dimension)
    network.load_named(arrays)
    prefix = "backbone.model" if release is checkpoints.megaloc else "backbone"
    c, x = Checkpoint(arrays), pictures(126, 126)
    tokens = c.layer_norm(f"{prefix}.norm", by_names.dinov2(c, prefix, x, heads=2), 1e-6)
    gathered = by_names.salad(c, "aggregator.agg", tokens)
    expected = by_names.unit(c.linear("aggregator.linear", gathered))
    torch.testing.assert_close(network.eval()(x), expected, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("backbone", ["resnet50", "dinov2"])
def test_boq_from_its_checkpoints(backbone: str) -> None:
    """Against PyTorch's own transformer layers, filled with the checkpoint's tensors."""
    arrays = checkpoints.seeded(checkpoints.boq(backbone, SMALL))
    width = 512 if backbone == "resnet50" else 384
    dino = small_dino if backbone == "dinov2" else lambda: None
    network = unfilled(lambda: BoqNet(backbone, width * 32, dino()))
    network.load_named(arrays)
    c, x = Checkpoint(arrays), pictures(126, 126)
    if backbone == "resnet50":
        x = pictures(64, 64)
        maps = by_names.resnet(c, [f"backbone.net.{n}" for n in (0, 1, 4, 5, 6)], x)
    else:
        tokens = by_names.dinov2(c, "backbone.dino", x, heads=2)[:, 1:]
        maps = tokens.permute(0, 2, 1).reshape(2, 64, 9, 9)
    got = network.eval()(x)
    assert got.shape == (2, width * 32)
    torch.testing.assert_close(got, _boq_by_torch(c, maps, width), rtol=1e-3, atol=1e-5)


def _boq_by_torch(c: Checkpoint, maps: Tensor, width: int) -> Tensor:
    def filled(module: nn.Module, prefix: str) -> nn.Module:
        module.load_state_dict({name: c[f"{prefix}.{name}"] for name in module.state_dict()})
        return module.eval()

    x = filled(nn.Conv2d(maps.shape[1], width, 3, padding=1), "aggregator.proj_c")(maps)
    x = c.layer_norm("aggregator.norm_input", x.flatten(2).permute(0, 2, 1), 1e-5)
    answers = []
    for bag in range(2):
        name, heads = f"aggregator.boqs.{bag}", width // 64
        layer = nn.TransformerEncoderLayer(width, heads, 4 * width, 0.0, batch_first=True)
        x = filled(layer, f"{name}.encoder")(x)
        among = filled(nn.MultiheadAttention(width, heads, batch_first=True), f"{name}.self_attn")
        asking = filled(nn.MultiheadAttention(width, heads, batch_first=True), f"{name}.cross_attn")
        queries = c[f"{name}.queries"].repeat(len(x), 1, 1)
        queries = c.layer_norm(
            f"{name}.norm_q", queries + among(queries, queries, queries)[0], 1e-5
        )
        answers.append(c.layer_norm(f"{name}.norm_out", asking(queries, x, x)[0], 1e-5))
    rows = c.linear("aggregator.fc", torch.cat(answers, 1).permute(0, 2, 1))
    return by_names.unit(rows.flatten(1))


def test_attention_and_encoder_are_pytorchs() -> None:
    torch.manual_seed(5)
    ours, theirs = (
        Encoder(128).eval(),
        nn.TransformerEncoderLayer(128, 2, 512, 0.0, batch_first=True).eval(),
    )
    theirs.load_state_dict(ours.state_dict())
    x, y = torch.randn(2, 7, 128), torch.randn(2, 5, 128)
    torch.testing.assert_close(ours(x), theirs(x), rtol=1e-4, atol=1e-5)
    attention, reference = Attention(128), nn.MultiheadAttention(128, 2, batch_first=True)
    reference.load_state_dict(attention.state_dict())
    torch.testing.assert_close(attention(x, y), reference(x, y, y)[0], rtol=1e-4, atol=1e-5)


def test_patches_are_shared_out_whole() -> None:
    """After many rounds every patch has given 1 and every cluster has taken 1."""
    torch.manual_seed(6)
    scores = 3 * torch.randn(2, 5, 12, dtype=torch.float64)
    shares = share_out(scores, torch.tensor(1.0, dtype=torch.float64), n_rounds=200)
    torch.testing.assert_close(shares.sum(2), torch.ones(2, 5, dtype=torch.float64))
    assert (shares.sum(1) <= 1 + 1e-9).all()
    assert (shares >= 0).all()


def test_positions_fit_every_picture() -> None:
    network = DinoV2(width=8, depth=0, heads=2)
    for height in range(1, 74):
        assert network._positions(height, 74 - height).shape == (1, 1 + height * (74 - height), 8)
    assert network._positions(37, 37) is network.pos_embed


def test_positions_resampled_keep_what_is_smooth() -> None:
    """A ramp over the trained grid stays a ramp over a coarser one, a tenth of a patch off.

    PyTorch's bicubic filter bends a ramp by 0.0013; without the tenth it were 0.0038 at the end.
    """
    network = DinoV2(width=2, depth=0, heads=1)
    ramp = torch.linspace(0, 1, 37)
    grid = torch.stack([ramp[:, None].expand(37, 37), ramp[None].expand(37, 37)], 2)
    network.pos_embed.copy_(torch.cat([torch.zeros(1, 1, 2), grid.reshape(1, -1, 2)], 1))
    positions = network._positions(23, 23)[0, 1:].reshape(23, 23, 2)
    centres = (torch.arange(23) + 0.5) / 23.1
    expected = ((centres * 37 - 0.5) / 36)[2:-2]
    torch.testing.assert_close(positions[2:-2, 5, 0], expected, rtol=0, atol=2e-3)
    torch.testing.assert_close(positions[5, 2:-2, 1], expected, rtol=0, atol=2e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda a: a.pop("backbone.7.1.conv2.weight"), r"no 'backbone.layer4.1.conv2.weight'"),
        (lambda a: a.update({"backbone.7.2.conv1.weight": np.zeros(1)}), "1 tensors too many"),
        (lambda a: a.update({"aggregation.3.bias": np.zeros(33)}), r"\(33,\), expected \(32,\)"),
    ],
)
def test_other_checkpoints_are_refused(change: Callable[..., object], message: str) -> None:
    arrays = {n: np.zeros(s, np.float32) for n, s in checkpoints.geo("ResNet18", 32).items()}
    change(arrays)
    with pytest.raises(InputError, match=message):
        unfilled(lambda: CosPlaceNet("ResNet18", 32)).load_named(arrays)


def test_larger_network_of_the_family_is_refused() -> None:
    arrays = {
        name: np.zeros(shape, np.float32)
        for name, shape in checkpoints.geo("ResNet101", 32).items()
    }
    # 17 more blocks of three convolutions and three norms of four arrays each.
    with pytest.raises(InputError, match="255 tensors too many"):
        unfilled(lambda: CosPlaceNet("ResNet50", 32)).load_named(arrays)
    without = {name: array for name, array in arrays.items() if "num_batches" not in name}
    with pytest.raises(InputError, match="too many"):
        unfilled(lambda: CosPlaceNet("ResNet50", 32)).load_named(without)
