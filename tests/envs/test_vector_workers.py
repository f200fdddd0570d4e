"""What steps the environments of a vector: Ctrl-C at any moment."""

from __future__ import annotations

from multiprocessing.connection import Connection
from typing import Any

import gymnasium
import numpy as np
import pytest

from tests.envs.cases import MOTION, rooms


@pytest.mark.parametrize("call", ["send_bytes", "recv_bytes"])
@pytest.mark.parametrize("late", [False, True], ids=["before", "behind"])
def test_ctrl_c_puts_no_answer_in_the_place_of_another(
    call: str, late: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A notebook is interrupted where a command goes to a worker or its answer comes, and goes on."""
    real = getattr(Connection, call)

    def interrupted(pipe: Connection, *given: Any) -> None:
        monkeypatch.undo()
        if late:
            real(pipe, *given)
        raise KeyboardInterrupt

    envs = gymnasium.make_vec(
        MOTION, num_envs=2, backend="processes", workers=2, plan=rooms(), sensor="short"
    )
    expected: list[Any] = []
    for _ in range(2):
        answers = [envs.reset(seed=3), *(envs.step(np.array([0, 1])) for _ in range(2))]
        infos = [answer[-1]["distance"].tolist() + answer[-1]["coverage"].tolist() for answer in answers]
        expected = expected or infos
        assert infos == expected
        monkeypatch.setattr(Connection, call, interrupted)
        with pytest.raises(KeyboardInterrupt):
            envs.step(np.array([0, 0]))
    assert envs.reset(seed=3)[1]["coverage"].tolist() == expected[0][2:]
    assert envs.call("plan_name") == (rooms().name,) * 2
    envs.close()
