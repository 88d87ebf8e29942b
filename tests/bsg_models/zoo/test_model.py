"""What all models share: their answers are computed on one thread."""

from __future__ import annotations

from threadpoolctl import threadpool_info, threadpool_limits

from bsg_models.zoo.model import one_thread


def list_threads() -> set[int]:
    """Return the numbers of threads of all libraries that multiply matrices."""
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_the_last_of_several_answers_gives_the_threads_back() -> None:
    with threadpool_limits(2, user_api="blas"):
        first, second = one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert list_threads() == {1}
        second.__exit__(None, None, None)
        assert list_threads() == {2}
