import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glazefit.film.least_squares import GramSchmidt, NormalEquations, back_substitute, orthogonalise


def solve(matrix, vector):
    return lx.linear_solve(
        lx.MatrixLinearOperator(jnp.asarray(matrix)), jnp.asarray(vector), GramSchmidt()
    ).value


@given(st.integers(0, 2**31), st.integers(1, 4), st.integers(0, 3), st.floats(0, 6))
def test_agrees_with_numpy(seed, columns, spare, spread):
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((columns + spare, columns)) * 10 ** -np.linspace(
        0, spread, columns
    )
    vector = rng.standard_normal(columns + spare)
    expected = np.linalg.lstsq(matrix, vector, rcond=None)[0]
    np.testing.assert_allclose(
        solve(matrix, vector), expected, rtol=1e-6 * np.linalg.cond(matrix) ** 0.5
    )


@pytest.mark.parametrize("columns", [1, 7, 30])
def test_normal_equations_agree_with_numpy(columns):
    rng = np.random.default_rng(columns)
    matrix, vector = rng.standard_normal((columns + 10, columns)), rng.standard_normal(columns + 10)
    operator = lx.MatrixLinearOperator(jnp.asarray(matrix))
    value = lx.linear_solve(operator, jnp.asarray(vector), NormalEquations()).value
    np.testing.assert_allclose(
        value, np.linalg.lstsq(matrix, vector, rcond=None)[0], rtol=1e-8, atol=1e-10
    )


def test_factors_stay_orthogonal_for_nearly_dependent_columns():
    # The Lauchli matrix, where one Gram-Schmidt sweep loses orthogonality.
    matrix = jnp.asarray([[1.0, 1, 1], [1e-8, 0, 0], [0, 1e-8, 0], [0, 0, 1e-8]])
    q, r = orthogonalise(matrix)
    np.testing.assert_allclose(q.T @ q, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(q @ r, matrix, atol=1e-15)


def test_unknown_that_is_not_determined_is_zero():
    value = solve([[1.0, 0.0], [2.0, 0.0], [0.0, 0.0]], [1.0, 2.0, 5.0])
    np.testing.assert_allclose(value, [1.0, 0.0])


def test_an_upper_triangle_is_solved_and_zero_pivots_give_zero():
    rng = np.random.default_rng(2)
    r, x = np.triu(rng.uniform(0.5, 2.0, (4, 4))), rng.standard_normal(4)
    np.testing.assert_allclose(back_substitute(jnp.asarray(r), jnp.asarray(r @ x)), x, rtol=1e-12)
    # A pivot of -1 is a number like others.
    r[1, 1] = -1.0
    np.testing.assert_allclose(back_substitute(jnp.asarray(r), jnp.asarray(r @ x)), x, rtol=1e-12)
    found = back_substitute(jnp.asarray([[2.0, 1.0], [0.0, 0.0]]), jnp.asarray([3.0, 5.0]))
    np.testing.assert_array_equal(found, [1.5, 0.0])


def test_pytrees_keep_their_structure():
    def scale(x):
        return {"p": 2.0 * x["a"], "q": 3.0 * x["b"]}

    structure = jax.eval_shape(lambda: {"a": jnp.zeros(()), "b": jnp.zeros(1)})
    operator = lx.FunctionLinearOperator(scale, structure)
    value = lx.linear_solve(
        operator, {"p": jnp.asarray(4.0), "q": jnp.asarray([9.0])}, GramSchmidt()
    ).value
    assert value["a"] == pytest.approx(2.0)
    np.testing.assert_allclose(value["b"], [3.0])


def test_wide_problems_are_refused():
    with pytest.raises(ValueError, match="tall problems"):
        solve(np.ones((1, 2)), np.ones(1))


@pytest.mark.processor
def test_no_lapack_in_the_program():
    matrices, vectors = jnp.ones((5, 4, 2)), jnp.ones((5, 4))
    text = jax.jit(jax.vmap(solve)).lower(matrices, vectors).compile().as_text()
    assert text is not None
    assert "lapack_" not in text
    qr = jax.jit(jax.vmap(jnp.linalg.qr)).lower(matrices).compile().as_text()
    assert qr is not None
    assert "lapack_" in qr, "the search would find nothing anyway"
