"""Tiny random networks, saved as real ones are, make a picture and a mesh through the loaders that real ones take."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from torchvision_without_kernels import make_importable
from vico.assets.object_generation import GeneratedObject, GenerationRequest, Networks, generate_from_text
from vico.errors import InputError
from vico.io.diffusion import model_folder


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Stable Diffusion and Shap-E of a few thousand random weights, saved as their real ones are."""
    if why := make_importable():
        pytest.skip(why)
    for name in ("diffusers", "transformers"):
        pytest.importorskip(name, reason=f"{name} is not installed: the extra diffusion")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of packages that we only ask for toy models here
        return _saved(tmp_path_factory.mktemp("tiny"))


def surface_in_cell(mask: int) -> list[list[int]]:
    """Triangles between a cell's edges, by which corners lie inside: real weights bring such a table; convex ones here.

    Corners are numbered x + 2 y + 4 z; edges along x, then y, then z, each by the other two coordinates.
    """
    middles = []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for low, high in ((0, 0), (1, 0), (0, 1), (1, 1)):
            middle = np.full(3, 0.5)
            middle[others] = low, high
            middles.append(middle)
    inside = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8) if mask >> c & 1], float)
    crossed = []
    for number, middle in enumerate(middles):
        ends = [np.where(middle == 0.5, end, middle).astype(int) @ (1, 2, 4) for end in (0, 1)]
        if (mask >> ends[0] & 1) != (mask >> ends[1] & 1):
            crossed.append(number)
    spots = np.array([middles[k] for k in crossed])
    outwards = spots.mean(axis=0) - inside.mean(axis=0)
    if np.linalg.norm(outwards) < 1e-9:
        return []
    u = np.cross(outwards, (1.0, 0.3, 0.7))
    v = np.cross(outwards, u)
    around = spots - spots.mean(axis=0)
    order = np.argsort(np.arctan2(around @ v / np.linalg.norm(outwards), around @ u))
    ring = [crossed[k] for k in order]
    return [[ring[0], ring[k], ring[k + 1]] for k in range(1, len(ring) - 1)][:5]


def _saved(out: Path) -> Path:
    import diffusers as d
    import torch
    from diffusers.pipelines.shap_e import ShapERenderer
    from transformers import (
        CLIPImageProcessor,
        CLIPTextConfig,
        CLIPTextModel,
        CLIPTokenizer,
        CLIPVisionConfig,
        CLIPVisionModel,
    )

    torch.manual_seed(0)
    letters = [chr(c) for c in range(97, 123)]
    words = [*letters, *[f"{c}</w>" for c in letters], ",</w>", "<|startoftext|>", "<|endoftext|>"]
    (out / "vocab.json").write_text(json.dumps({word: k for k, word in enumerate(words)}))
    (out / "merges.txt").write_text("#version: 0.2\n")
    small = {"hidden_size": 32, "intermediate_size": 37, "num_attention_heads": 4, "num_hidden_layers": 1}
    last = len(words) - 1
    d.StableDiffusionPipeline(
        vae=d.AutoencoderKL(
            block_out_channels=(32,), latent_channels=4,
            down_block_types=("DownEncoderBlock2D",), up_block_types=("UpDecoderBlock2D",)),
        text_encoder=CLIPTextModel(CLIPTextConfig(
            vocab_size=len(words), hidden_act="gelu", bos_token_id=last - 1, eos_token_id=last, pad_token_id=last,
            **small)),
        tokenizer=CLIPTokenizer(str(out / "vocab.json"), str(out / "merges.txt"), model_max_length=77),
        unet=d.UNet2DConditionModel(
            block_out_channels=(32, 64), layers_per_block=1, sample_size=16, in_channels=4, out_channels=4,
            down_block_types=("DownBlock2D", "CrossAttnDownBlock2D"),
            up_block_types=("CrossAttnUpBlock2D", "UpBlock2D"), cross_attention_dim=32),
        scheduler=d.DDIMScheduler(steps_offset=1, clip_sample=False),
        safety_checker=None, feature_extractor=None, requires_safety_checker=False,
    ).save_pretrained(out / "picture")  # fmt: skip
    renderer = ShapERenderer(param_shapes=((8, 93), (8, 8), (8, 8), (8, 8)), d_latent=32, d_hidden=8, n_output=12)
    with torch.no_grad():
        renderer.mlp.mlp[-1].bias[0] = 1.0  # random weights have nothing inside: this fills the whole cube
        for mask in range(1, 255):
            for k, triangle in enumerate(surface_in_cell(mask)):
                renderer.mesh_decoder.cases[mask, k] = torch.tensor(triangle)
                renderer.mesh_decoder.masks[mask, k] = True
    d.ShapEImg2ImgPipeline(
        prior=d.PriorTransformer(
            num_attention_heads=2, attention_head_dim=16, embedding_dim=32, num_embeddings=32, embedding_proj_dim=32,
            time_embed_dim=128, num_layers=1, clip_embed_dim=64, additional_embeddings=0, time_embed_act_fn="gelu",
            norm_in_type="layer", embedding_proj_norm_type="layer", encoder_hid_proj_type=None, added_emb_type=None),
        image_encoder=CLIPVisionModel(CLIPVisionConfig(image_size=32, patch_size=8, projection_dim=32, **small)),
        image_processor=CLIPImageProcessor(crop_size=32, size=32),
        shap_e_renderer=renderer,
        scheduler=d.HeunDiscreteScheduler(
            beta_schedule="exp", num_train_timesteps=1024, prediction_type="sample", use_karras_sigmas=True,
            clip_sample=True, clip_sample_range=1.0),
    ).save_pretrained(out / "mesh")  # fmt: skip
    for name in ("picture", "mesh"):
        (out / name / "README.md").write_text("---\nlicense: apache-2.0\n---\n")
    return out


@pytest.mark.filterwarnings("default")
def test_tiny_random_networks_make_a_thing_and_the_same_again(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture, mesh = model_folder(tiny / "picture"), model_folder(tiny / "mesh")
    networks = Networks(picture, mesh, steps=2, mesh_steps=2, cells=16, side=32)
    request = GenerationRequest("a ball", 1.2, seed=4, faces=400)

    def made(cache: str) -> GeneratedObject:
        monkeypatch.setenv("VICO_CACHE", str(tmp_path / cache))
        return generate_from_text(request, networks)

    first, second = made("a"), made("b")
    assert first.picture == second.picture
    assert (first.surface.positions == second.surface.positions).all()
    assert first.surface.positions[:, 2].max() == pytest.approx(1.2)
    assert len(first.surface.triangles) <= 400
    assert first.licence == "apache-2.0"
    assert first.record["mesh"]["revision"] == mesh.digest
    Image.fromarray(np.full((40, 40, 4), (200, 60, 60, 128), np.uint8)).save(tmp_path / "seen.png")
    seen = generate_from_text(request, Networks(None, mesh, mesh_steps=2, cells=16), picture=tmp_path / "seen.png")
    assert seen.picture != first.picture
    assert "picture (" not in seen.credit
    with pytest.raises(InputError, match="its pipeline is StableDiffusionPipeline"):
        generate_from_text(request, Networks(picture, picture, steps=2, side=32))
