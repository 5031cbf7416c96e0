"""The fake box under any sequence of orders: what its outputs do, and what it says of it."""

from __future__ import annotations

from collections import Counter

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from stepped_box import SteppedBox

from rig.acquisition.trigger.edges import OUTPUTS, compile_edges, nearest
from rig.acquisition.trigger.fake.device import FakeSettings
from rig.acquisition.trigger.lines import MAX_ANSWER, LineReader
from rig.acquisition.trigger.protocol import Reply, Request, parse_answer

CAPTURES = st.sampled_from(["a", "b", "c"])


class BoxMachine(RuleBasedStateMachine):
    """Orders in any order, repeats, noise, resets, time; the outputs are watched."""

    @initialize(seed=st.integers(0, 100))
    def begin(self, seed: int) -> None:
        self.device = SteppedBox(FakeSettings(jitter_ticks=5, seed=seed))
        self.reader = LineReader(MAX_ANSWER)
        self.seq = 0
        self.armed_shots: Counter[str] = Counter()
        self.lines: list[bytes] = []
        self.generation = 0

    def exchange(self, line: bytes) -> Reply:
        """The first reply to a line; every event on the way must be readable too."""
        self.device.write(line)
        while True:
            for raw in self.reader.feed(self.device.read(4096)):
                said = parse_answer(raw)
                if isinstance(said, Reply):
                    return said

    def ask(self, command: str, **fields: str) -> Reply:
        self.seq += 1
        line = Request(self.seq, command, fields).line()
        if not command.endswith("?"):
            self.lines.append(line)
        return self.exchange(line)

    def unique(self, capture: str) -> str:
        """Ids are never used twice by a host that keeps the rules."""
        return f"{capture}{self.generation}"

    @rule(output=st.integers(1, 16), delay=st.integers(0, 20), width=st.integers(0, 9))
    def set_output(self, output: int, delay: int, width: int) -> None:
        self.ask("OUT", ch=str(output), d=str(delay * 100), w=str(width * 100))

    @rule(capture=CAPTURES, shots=st.integers(1, 3), mask=st.integers(0, 65535))
    def arm(self, capture: str, shots: int, mask: int) -> None:
        self.generation += 1
        name = self.unique(capture)
        reply = self.ask(
            "ARM",
            cap=name,
            mask=f"{mask:04X}",
            n=str(shots),
            iv=str(10_000 if shots > 1 else 0),
            lead="2000",
            ttl="2000",
        )
        if reply.ok:
            self.armed_shots[name] = shots

    @rule(capture=CAPTURES)
    def fire(self, capture: str) -> None:
        reply = self.ask("FIRE", cap=self.unique(capture))
        assert not (reply.ok and self.unique(capture) not in self.armed_shots)

    @rule(back=st.integers(1, 6))
    def repeat(self, back: int) -> None:
        if len(self.lines) >= back:
            self.exchange(self.lines[-back])

    @rule(command=st.sampled_from(["ABORT", "*RST", "*CLS"]))
    def order(self, command: str) -> None:
        assert self.ask(command).ok

    @rule(capture=CAPTURES)
    def disarm(self, capture: str) -> None:
        self.ask("DISARM", cap=self.unique(capture))

    @rule(milliseconds=st.integers(0, 3500))
    def let_time_pass(self, milliseconds: int) -> None:
        self.device.wait(milliseconds / 1000.0)

    @rule(closed=st.booleans())
    def move_interlock(self, closed: bool) -> None:
        self.device.box.set_interlock(closed)

    @rule(keeps_power=st.booleans())
    def reset(self, keeps_power: bool) -> None:
        self.device.box.reset("WATCHDOG", keeps_power)

    @rule(noise=st.binary(max_size=120))
    def disturb(self, noise: bytes) -> None:
        self.device.write(noise + b"\n")
        self.device.read(4096)
        self.reader.clear()
        self.device.read(1_000_000)

    @invariant()
    def every_capture_pulses_each_output_once_a_shot_at_most(self) -> None:
        rises = Counter(
            (edge.capture, edge.output) for edge in self.device.box.edges if edge.rising
        )
        for (capture, _), count in rises.items():
            assert count <= self.armed_shots[capture]

    @invariant()
    def outputs_alternate_and_rest_low(self) -> None:
        levels = dict.fromkeys(range(1, OUTPUTS + 1), False)
        for edge in self.device.box.edges:
            assert levels[edge.output] != edge.rising
            levels[edge.output] = edge.rising
        if self.device.box.state != "FIRING":
            assert not any(levels.values())

    @invariant()
    def what_it_calls_fired_was_fired_whole(self) -> None:
        for name, shots in self.armed_shots.items():
            capture = self.device.box.captures.find(name)
            if capture is None:
                continue
            rises = [e for e in self.device.box.edges if e.capture == name and e.rising]
            if capture.result == "FIRED":
                assert len(capture.shots) == shots
                assert len(rises) >= shots
            elif capture.result in ("ARMED", "NOT_FIRED"):
                assert not rises


TestBoxMachine = BoxMachine.TestCase
TestBoxMachine.settings = settings(
    max_examples=150,
    stateful_step_count=40,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=True,
)


def test_simultaneous_edges_are_one_instant() -> None:
    edges = compile_edges({1: (0, 100), 2: (100, 50), 16: (0, 150)}, 0xFFFF)
    assert [(edge.at, edge.pins) for edge in edges] == [(0, 0x8001), (100, 0x8002), (150, 0)]
    assert nearest(edges) == 50


def test_masked_and_empty_outputs_make_no_edge() -> None:
    assert compile_edges({1: (0, 100), 2: (0, 0)}, 0xFFFE) == ()
