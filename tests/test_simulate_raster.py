"""The depth buffer against a plain search over all triangles."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scan2nurbs.kernels import raster


def soup(seed, n, size):
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-2, size + 2, (n, 1, 3))
    return np.ascontiguousarray(middle + rng.normal(scale=size / 4, size=(n, 3, 3)))


def rays(seed, jitter, rows, columns):
    return np.array([[raster._ray(seed, jitter, i, j) for j in range(columns)] for i in range(rows)])


def weights(triangle, at):
    """Solve for the barycentric weights of points (..., 2)."""
    system = np.vstack([triangle[:, :2].T, np.ones(3)])
    right = np.concatenate([at, np.ones((*at.shape[:-1], 1))], axis=-1)
    return np.linalg.solve(system, right.reshape(-1, 3).T).T.reshape(*at.shape[:-1], 3)


@given(seed=st.integers(0, 10**6), n=st.integers(1, 12), jitter=st.sampled_from([0.0, 0.25, 0.5]), split=st.integers(0, 9))
def test_depth_buffer_equals_a_search_over_all_triangles(seed, n, jitter, split):
    triangles, shape = soup(seed, n, 9), (9, 11)
    depth, hit = np.full(shape, np.inf), np.full(shape, -1, np.int32)
    raster.depth_range(triangles, seed, jitter, 0, split, depth, hit)
    raster.depth_range(triangles, seed, jitter, split, shape[0], depth, hit)
    w = np.stack([weights(t, rays(seed, jitter, *shape)) for t in triangles])
    z = np.where(w.min(axis=-1) >= 0, np.einsum("tijk,tk->tij", w, triangles[:, :, 2]), np.inf)
    nearest = z.min(axis=0)
    clear = np.abs(w.min(axis=-1)).min(axis=0) > 1e-7  # rays through an edge may go either way
    assert np.allclose(depth[clear], nearest[clear], rtol=1e-9, atol=1e-9)
    assert np.array_equal(hit[clear], np.where(np.isinf(nearest), -1, z.argmin(axis=0))[clear])


@given(seed=st.integers(0, 10**6))
def test_weights_put_the_point_on_its_ray(seed):
    triangles, shape = soup(seed, 6, 9), (9, 11)
    depth, hit = np.full(shape, np.inf), np.full(shape, -1, np.int32)
    raster.depth_range(triangles, seed, 0.3, 0, shape[0], depth, hit)
    pixel = np.flatnonzero(hit >= 0)
    triangle = hit.ravel()[pixel].astype(np.int64)
    weight = np.empty((len(pixel), 3))
    raster.weights_range(triangles, seed, 0.3, shape[1], pixel, triangle, 0, len(pixel), weight)
    places = np.einsum("nkc,nk->nc", triangles[triangle], weight)
    assert np.allclose(places[:, :2], rays(seed, 0.3, *shape).reshape(-1, 2)[pixel], atol=1e-5)
    assert np.allclose(places[:, 2], depth.ravel()[pixel], atol=1e-5)


@given(seed=st.integers(0, 10**6))
def test_collecting_finds_every_ray_in_every_triangle(seed):
    triangles, shape = np.add(soup(seed, 5, 9), [20.0, 20.0, 0.0]), (60, 60)
    count = np.zeros(5, np.int64)
    raster.count_range(triangles, seed, 0.4, 0, 5, count)
    at = rays(seed, 0.4, *shape)
    inside = np.array([(weights(t, at).min(axis=-1) >= 0).sum() for t in triangles])
    assert np.array_equal(count, inside)
    first = np.concatenate([[0], np.cumsum(count)])
    weight = np.full((first[-1], 3), np.nan)
    raster.collect_range(triangles, seed, 0.4, first, 0, 5, weight)
    assert (weight >= 0).all()
    assert np.allclose(weight.sum(axis=1), 1)


def test_an_edge_on_triangle_is_met_by_no_ray():
    flat = np.array([[[2.0, 2.0, 0.0], [6.0, 6.0, 1.0], [4.0, 4.0, 5.0]]])
    depth, hit = np.full((8, 8), np.inf), np.full((8, 8), -1, np.int32)
    raster.depth_range(flat, 0, 0.0, 0, 8, depth, hit)
    assert (hit == -1).all()


def test_wobble_is_even_over_its_range():
    values = np.array([raster._wobble(7, i, j, a) for i in range(-20, 40) for j in range(40) for a in range(2)])
    assert ((values >= -1) & (values < 1)).all()
    assert np.histogram(values, 10, (-1, 1))[0].min() > 0.8 * len(values) / 10
    assert abs(np.corrcoef(values[::2], values[1::2])[0, 1]) < 0.05
