"""Strategies for every message of the link."""

from __future__ import annotations

from hypothesis import strategies as st

from shapechanger.link.messages import (
    Acknowledge,
    Arm,
    Challenge,
    ClientMessage,
    Command,
    Disarm,
    EmergencyStop,
    Event,
    Hello,
    Lease,
    Observation,
    Ping,
    Pong,
    Refused,
    Release,
    RobotMessage,
    Take,
    Welcome,
)

_texts = st.text(max_size=40)
_counts = st.integers(0, 2**53)
_times = st.integers(-(2**63), 2**63 - 1)
_numbers = st.floats(allow_nan=False)
_vectors = st.lists(_numbers, max_size=8).map(tuple)

client_messages: st.SearchStrategy[ClientMessage] = st.one_of(
    st.builds(
        Hello,
        version=_times,
        proof=st.binary(max_size=64),
        name=_texts,
        role=st.sampled_from(("person", "program")),
        pace=st.sampled_from(("realtime", "lockstep")),
        frames=st.booleans(),
    ),
    st.builds(
        Command,
        seq=_counts,
        answers=_counts,
        values=_vectors,
        ttl_ms=st.integers(1, 60_000),
        scale=st.floats(0.0, 1.0),
    ),
    st.builds(Acknowledge, seq=_counts),
    st.builds(Take),
    st.builds(Release),
    st.builds(Arm, answers=_counts, emergency=_counts),
    st.builds(Disarm),
    st.builds(EmergencyStop, reason=_texts),
    st.builds(Ping, token=_counts),
)

robot_messages: st.SearchStrategy[RobotMessage] = st.one_of(
    st.builds(Challenge, version=_counts, nonce=st.binary(max_size=64), robot=_texts),
    st.builds(
        Welcome,
        robot=_texts,
        body=_texts,
        action_layout=_texts,
        state_layout=_texts,
        image_size=st.none() | st.tuples(_counts, _counts),
        control_hz=_numbers,
        deadline_ms=_counts,
        max_observation_age_ms=_counts,
        reward=st.dictionaries(_texts, _numbers, max_size=4),
        reset=st.lists(st.tuples(_vectors, _numbers), max_size=3).map(tuple),
        arming=st.sampled_from(("person", "anyone")),
        clock=st.sampled_from(("real", "twin")),
        session=_counts,
    ),
    st.builds(Refused, reason=_texts, seq=st.none() | _counts, fatal=st.booleans()),
    st.builds(
        Observation,
        seq=_counts,
        captured_ns=_times,
        state_ns=_times,
        sent_ns=_times,
        frame=st.none() | st.binary(max_size=200),
        frame_seq=_counts,
        state=_vectors,
        sources=st.dictionaries(_texts, _texts, max_size=4),
        action_applied=_vectors,
        applied_seq=st.none() | _counts,
        applied_ns=st.none() | _times,
        command_ns=st.none() | _times,
        stop_reason=_texts,
        armed=st.booleans(),
        emergency=st.booleans(),
        emergencies=_counts,
        holder=_texts,
        mine=st.booleans(),
    ),
    st.builds(Lease, mine=st.booleans(), holder=_texts, reason=_texts),
    st.builds(Event, name=_texts, text=_texts, at_ns=_times),
    st.builds(Pong, token=_counts, now_ns=_times),
)
