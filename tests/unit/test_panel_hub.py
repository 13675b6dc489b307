"""History, newest state and the operator's seat, without a network."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rig.panel import hub as hubs
from rig.panel.hub import Hub, Viewer


class Time:
    """A clock that stands still until it is moved."""

    def __init__(self) -> None:
        self.t = 1000.0

    def __call__(self) -> float:
        return self.t


@pytest.fixture
def now() -> Time:
    return Time()


@pytest.fixture
def hub(now: Time) -> Hub:
    return Hub("run", now)


def viewer(client: str = "one", *, may_take: bool = True, seen: int | None = None) -> Viewer:
    return Viewer(client, may_take, seen=seen)


def sent(hub: Hub, to: Viewer) -> list[dict[str, Any]]:
    """Messages of one look; the last id is under "id"."""
    messages = []
    for block in hub.news(to).decode().split("\n\n")[:-1]:
        lines = dict(line.split(": ", 1) for line in block.split("\n"))
        message = json.loads(lines["data"])
        messages.append(message | ({"id": lines["id"]} if "id" in lines else {}))
    return messages


def everything(hub: Hub, to: Viewer) -> list[int]:
    """Numbers of all samples that the viewer holds in the end."""
    rows: list[int] = []
    while hub.lacks(to):
        for message in sent(hub, to):
            if "reset" in message:
                rows.clear()
            rows += [item["sample"] for item in message.get("batch", []) if "sample" in item]
    return rows


def state(force_age_s: float | None = 0.1, *, stale: bool = False) -> dict[str, Any]:
    value = {"N": 1.0, "mm": 1.0, "age_s": force_age_s, "stale": stale}
    return {"phase": "turning", "force": value, "displacement": dict(value)}


def test_who_comes_late_gets_the_whole_run_in_parts(hub: Hub) -> None:
    for row in range(1234):
        hub.add({"sample": row})
    hub.add({"plan": {"title": "t"}})
    late = viewer()
    first = sent(hub, late)
    assert first[0] == {"reset": "run", "id": "run:0"}
    assert first[1]["batch"] == [{"plan": {"title": "t"}}]
    assert len(first[2]["batch"]) == hubs.BATCH
    assert first[2]["id"] == f"run:{hubs.BATCH}"
    assert len(everything(hub, late)) == 1234 - hubs.BATCH


def test_who_reconnects_gets_what_he_missed_and_no_reset(hub: Hub) -> None:
    for row in range(10):
        hub.add({"sample": row})
    back = viewer(seen=hub.first_seen("run:7"))
    messages = sent(hub, back)
    assert not any("reset" in message for message in messages)
    assert messages[0]["batch"] == [{"sample": 7}, {"sample": 8}, {"sample": 9}]


@pytest.mark.parametrize("last", ["other:7", "run:11", "run:-1", "run:x", "7", "", None, "run:²"])
def test_an_id_of_another_run_or_none_starts_anew(hub: Hub, last: str | None) -> None:
    for row in range(10):
        hub.add({"sample": row})
    assert hub.first_seen(last) is None


def test_history_is_bounded_and_a_gap_is_no_gap(hub: Hub, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hubs, "KEPT_ITEMS", 100)
    small = Hub("run")
    slow = viewer()
    small.add({"sample": -1})
    everything(small, slow)
    for row in range(1000):
        small.add({"sample": row})
    # What he missed is no longer held, so he starts anew with what there is.
    assert everything(small, slow) == list(range(900, 1000))
    assert everything(small, viewer()) == list(range(900, 1000))


def test_the_plan_is_told_to_who_was_there_before_it(hub: Hub) -> None:
    early = viewer()
    sent(hub, early)
    hub.add({"plan": {}})
    assert hub.lacks(early)
    assert sent(hub, early) == [{"batch": [{"plan": {}}], "id": "run:0"}]


def test_only_the_newest_state_is_sent(hub: Hub, now: Time) -> None:
    slow = viewer()
    sent(hub, slow)
    for n in range(50):
        hub.set_state(state() | {"n": n}, now.t)
    states = [m for m in sent(hub, slow) if "seq" in m]
    assert [m["n"] for m in states] == [49]
    assert sent(hub, slow) == []


def test_a_value_grows_old_though_nobody_says_so(hub: Hub, now: Time) -> None:
    to = viewer()
    hub.set_state(state(0.1), now.t - 0.2)
    fresh = sent(hub, to)[-1]
    assert fresh["force"]["age_s"] == pytest.approx(0.3)
    assert not fresh["force"]["stale"]
    now.t += hubs.HEARTBEAT_S
    assert sent(hub, to)[-1]["force"]["age_s"] == pytest.approx(0.3 + hubs.HEARTBEAT_S)
    now.t += 0.5
    old = sent(hub, to)[-1]
    assert old["force"]["stale"]
    assert old["displacement"]["stale"]
    assert old["seq"] > fresh["seq"]


def recent(hub: Hub, to: Viewer) -> list[list[float | None]]:
    rows = [message["recent"] for message in sent(hub, to) if "recent" in message]
    return rows[0] if rows else []


def test_who_comes_late_is_told_the_last_two_minutes_once(hub: Hub, now: Time) -> None:
    early = viewer()
    assert recent(hub, early) == []
    for n in range(1500):
        now.t += 0.1
        hub.set_state(state(stale=n == 1490), now.t)
        hub.set_state(state(), now.t + 0.01)  # faster than anybody sees
    assert recent(hub, early) == [], "he has had the states"
    late = viewer()
    rows = recent(hub, late)
    assert len(rows) == pytest.approx(1200, abs=1)
    assert rows[0][0] == pytest.approx(now.t - 120, abs=0.11)
    assert rows[-1] == pytest.approx([now.t, 1.0, 1.0])
    assert [n for n, row in enumerate(rows) if row[1] is None] == [len(rows) - 10]
    hub.set_state(state(), now.t)
    assert recent(hub, late) == []


def test_no_line_leads_across_a_time_in_which_nothing_came(hub: Hub, now: Time) -> None:
    hub.set_state(state(), now.t)
    hub.set_state(state(), now.t + 5)
    forces = [row[1] for row in recent(hub, viewer())]
    assert forces == [1.0, None, 1.0]


def test_what_the_measurement_calls_stale_stays_so(hub: Hub, now: Time) -> None:
    hub.set_state(state(0.0, stale=True), now.t)
    assert sent(hub, viewer())[-1]["force"]["stale"]
    hub.set_state(state(None), now.t)
    assert sent(hub, viewer())[-1]["force"] == {
        "N": 1.0,
        "mm": 1.0,
        "age_s": None,
        "stale": True,
    }


def test_the_end_comes_after_everything_else(hub: Hub) -> None:
    for row in range(700):
        hub.add({"sample": row})
    hub.finish({"phase": "done", "text": "all runs done"})
    hub.finish({"phase": "fault", "text": "too late"})
    to = viewer()
    assert "end" not in sent(hub, to)[-1]
    assert sent(hub, to)[-1] == {"end": {"phase": "done", "text": "all runs done"}}
    assert to.ended
    assert not hub.lacks(to)


def operator(hub: Hub, now: Time, to: Viewer) -> dict[str, bool]:
    hub.set_state(state(), now.t)
    told: dict[str, bool] = sent(hub, to)[-1]["operator"]
    return told


def test_the_first_with_the_operators_link_operates(hub: Hub, now: Time) -> None:
    looker, first, second = viewer("look", may_take=False), viewer("first"), viewer("second")
    for each in (looker, first, second):
        hub.seat.join(each)
    assert operator(hub, now, looker) == {"you": False, "taken": True, "may_take": False}
    assert operator(hub, now, first) == {"you": True, "taken": True, "may_take": True}
    assert operator(hub, now, second) == {"you": False, "taken": True, "may_take": True}


def test_taking_over_is_explicit(hub: Hub) -> None:
    hub.seat.join(viewer("first"))
    hub.seat.join(viewer("second"))
    assert hub.seat.holder == "first"
    hub.seat.take("second")
    assert hub.seat.holder == "second"


def test_who_takes_over_without_a_stream_has_to_come_back_soon(hub: Hub, now: Time) -> None:
    hub.seat.join(viewer("first"))
    now.t += 100
    hub.seat.take("second")
    now.t += hubs.SEAT_GRACE_S - 0.1
    assert hub.seat.holder == "second"
    now.t += 0.2
    assert hub.seat.holder is None


def test_a_reload_keeps_the_seat_and_a_long_absence_loses_it(hub: Hub, now: Time) -> None:
    first, second = viewer("first"), viewer("second")
    hub.seat.join(first)
    hub.seat.leave(first)
    assert hub.seat.empty
    hub.seat.join(second)
    assert hub.seat.holder == "first"
    now.t += hubs.SEAT_GRACE_S - 0.1
    hub.seat.join(viewer("first"))  # the reloaded page
    now.t += 100
    assert hub.seat.holder == "first"
    hub.seat.leave(first)
    now.t += hubs.SEAT_GRACE_S
    assert hub.seat.holder is None
    hub.seat.join(viewer("third"))
    assert hub.seat.holder == "third"


def test_one_page_in_two_streams_leaves_with_the_second(hub: Hub, now: Time) -> None:
    hub.seat.join(viewer("first"))
    hub.seat.join(viewer("first"))
    hub.seat.leave(viewer("first"))
    now.t += 100
    assert hub.seat.holder == "first"
