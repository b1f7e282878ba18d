"""Tables of kernels: right, grown without a change, kept in a file, refused when damaged."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from glazejax.radiative.auxiliary.kernel_table import MOST_SEGMENTS, KernelTable
from tests.tolerances import ROUNDING

from ..refusals import refusal
from .cases import from_inside


@pytest.mark.parametrize("n", [1.0, 1.5, 2.5])
def test_kernels_are_the_integrals_of_the_paper(n):
    step = 0.07
    table = KernelTable(n, step, 6)
    critical = np.sqrt(1 - 1 / n**2)

    def over_mu(f):
        pieces = [0.0, critical, 1.0] if n > 1 else [0.0, 1.0]
        return sum(
            quad(f, a, b, epsabs=1e-13, epsrel=1e-12)[0] for a, b in itertools.pairwise(pieces)
        )

    def check(found, integrand):
        assert found == pytest.approx(over_mu(integrand), abs=ROUNDING, rel=0)

    def left(m, near, far):
        """Integrated over a segment first, so that only the integral over mu is numerical."""
        return np.exp(-near * step / m) - np.exp(-far * step / m)

    for k in range(1, 6):
        check(table.toeplitz[k], lambda m, k=k: left(m, k - 0.5, k + 0.5))
    check(table.toeplitz[0], lambda m: 2 * left(m, 0, 0.5))
    for k in range(11):
        check(table.hankel[k], lambda m, k=k: from_inside(m, n) * left(m, k + 0.5, k + 1.5))
    check(table.e3[2], lambda m: m * np.exp(-2 * step / m))
    check(table.j2[3], lambda m: from_inside(m, n) * m * np.exp(-3 * step / m))


def test_growing_computes_only_what_is_new():
    table, whole = KernelTable(1.5, 0.02, 10), KernelTable(1.5, 0.02, 25)
    before = table.hankel.copy()
    assert table.terms == 29
    assert table.grow(25) == 45
    assert table.grow(7) == 0
    assert table.segments == 25
    assert np.array_equal(table.hankel[:19], before)
    assert np.array_equal(table.hankel, whole.hankel)
    assert np.array_equal(table.toeplitz, whole.toeplitz)
    assert KernelTable(1.5, 0.02).terms == 0


def test_kept_in_a_file(tmp_path):
    table = KernelTable(1.33, 0.05, 12)
    path = table.save(tmp_path / "kernels.npz")
    assert [p.name for p in tmp_path.iterdir()] == ["kernels.npz"]
    with refusal("overwrite=True", FileExistsError):
        table.save(path)
    table.grow(20)
    table.save(path, overwrite=True)
    again = KernelTable.load(path)
    assert (
        repr(again) == repr(table) == "KernelTable(refractive_index=1.33, step=0.05, segments=20)"
    )
    assert np.array_equal(again.hankel, table.hankel)
    assert again.grow(30) == 30
    assert np.array_equal(again.j2, KernelTable(1.33, 0.05, 30).j2)


def test_files_that_hold_no_table_are_refused(tmp_path):
    with refusal("no kernel table at", FileNotFoundError):
        KernelTable.load(tmp_path / "absent.npz")
    (tmp_path / "text.npz").write_text("step,0.01\n")
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    held: dict = {name: np.zeros(0) for name in ("e2", "e3", "j1", "j2")} | {
        "refractive_index": 1.5,
        "step": 0.1,
    }
    np.savez(tmp_path / "version.npz", format="glazejax kernel table 99", **held)
    held |= {"format": "glazejax kernel table 1", "e2": np.zeros(4)}
    np.savez(tmp_path / "short.npz", **held)
    for name, message in [
        ("text", "is no kernel table"),
        ("other", "is no kernel table"),
        ("version", "this version reads"),
        ("short", "is damaged: e3"),
    ]:
        with refusal(message):
            KernelTable.load(tmp_path / f"{name}.npz")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"refractive_index": 0.9}, "refractive_index is 0.9"),
        ({"step": 0.0}, "step is 0.0"),
        ({"step": float("nan")}, "step is nan"),
        ({"segments": MOST_SEGMENTS + 1}, "use a larger step"),
    ],
)
def test_bad_arguments(given, message):
    with refusal(message):
        KernelTable(**given)
