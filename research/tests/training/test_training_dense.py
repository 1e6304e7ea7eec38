"""The network that is fitted and the model that is written say the same; classes count as they should."""

import numpy as np
import onnx
import pytest
from scipy.special import softmax

torch = pytest.importorskip("torch", reason="torch, of the extra 'train', is not installed")

from lidarspectra.material.segmentation.segmentation import load_model  # noqa: E402
from research.training.backbone import STAGES  # noqa: E402
from research.training.backbone_model import write_card  # noqa: E402
from research.training.dense_network import DenseNetwork, save_network  # noqa: E402
from research.training.fine_tuned import Frequencies, loss_of, place_shares  # noqa: E402
from research.training.fine_tuned_model import save_joined  # noqa: E402
from research.training.graph import Graph  # noqa: E402
from research.training.pictures import CLASSES  # noqa: E402


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    return DenseNetwork(STAGES).eval()


@pytest.mark.parametrize("shape", [(128, 160), (144, 176)])
def test_the_written_model_says_what_the_fitted_network_says_over_the_temperature(network, tmp_path, shape):
    path = tmp_path / "model.onnx"
    state = {name: value.double().numpy() for name, value in network.state_dict().items()}
    save_network(state, STAGES, 2.0, path)
    values = np.random.default_rng(0).normal(size=(1, 3, *shape)).astype(np.float32)
    with torch.no_grad():
        expected = network(torch.from_numpy(values)).numpy() / 2.0
    found = load_model(path, threads=1).run(None, {"image": values})[0]
    assert found.shape == (1, len(CLASSES), shape[0] // 16, shape[1] // 16)
    assert np.abs(found - expected).max() < 0.02 * np.abs(expected).max()  # weights are written in half precision


def test_the_share_of_a_place_that_shows_no_class_is_left_out():
    label = torch.full((1, 32, 16), -1)
    label[0, :16, :4] = 3
    label[0, :16, 4:12] = 5
    shares = place_shares(label)[0]
    assert shares.shape == (len(CLASSES), 2, 1)
    assert shares[3, 0, 0] == pytest.approx(0.25)
    assert shares[5, 0, 0] == pytest.approx(0.5)
    assert float(shares[:, 1].sum()) == 0.0


def test_logits_of_classes_that_look_alike_come_out_even_however_often_each_is_seen():
    share = torch.full((len(CLASSES),), 0.01)
    share[0], share[1] = 0.6, 0.22
    frequencies = Frequencies(share=share / share.sum())
    assert float(frequencies.log_prior.exp().sum()) == pytest.approx(1.0)
    # Places that all look the same show each class as often as it is seen.
    shares = frequencies.share[None, :, None, None].repeat(1, 1, 4, 4)
    logits = torch.zeros((1, len(CLASSES), 4, 4), requires_grad=True)
    loss_of(logits, shares, frequencies).backward()
    slope = logits.grad.sum(dim=(0, 2, 3))
    tilted = torch.zeros_like(logits)
    tilted[:, 0] = 1.0
    tilted.requires_grad_(True)
    loss_of(tilted, shares, frequencies).backward()
    # Smoothing of the labels draws them towards even, by a twentieth.
    assert float(slope.abs().max()) < 0.05
    assert float(tilted.grad[:, 0].sum()) > 0.1


def test_two_models_joined_say_the_mean_of_their_probabilities(tmp_path):
    random = np.random.default_rng(1)
    values = random.normal(size=(1, 3, 32, 32)).astype(np.float32)
    files = [tmp_path / "first.onnx", tmp_path / "second.onnx"]
    for file in files:
        graph = Graph()
        answer = graph.convolve(
            "image", 0.05 * random.normal(size=(len(CLASSES), 3, 16, 16)), np.zeros(len(CLASSES)), stride=16
        )
        onnx.save(graph.model(answer, len(CLASSES)), str(file))
    write_card(files[1].with_suffix(".toml"))
    text = files[1].with_suffix(".toml").read_text()
    files[1].with_suffix(".toml").write_text(
        text.replace("mean = [127.0, 127.0, 127.0]", "mean = [100.0, 110.0, 120.0]").replace("0.0078125", "0.02")
    )
    save_joined(files[0], files[1], tmp_path / "joined.onnx")
    stored = values * 128.0 + 127.0
    second = (stored - np.array([100.0, 110.0, 120.0]).reshape(1, 3, 1, 1)) * 0.02
    fed = (values, second.astype(np.float32))
    logits = [load_model(f, threads=1).run(None, {"image": v})[0] for f, v in zip(files, fed, strict=True)]
    found = load_model(tmp_path / "joined.onnx", threads=1).run(None, {"image": values})[0]
    expected = np.mean([softmax(logit.astype(np.float64), axis=1) for logit in logits], axis=0)
    assert np.allclose(np.exp(found), expected, atol=1e-4)
