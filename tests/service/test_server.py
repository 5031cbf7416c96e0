"""The server process: how it sends."""

from __future__ import annotations

import time

from service_helpers import StartServer


def test_an_answer_does_not_wait_for_its_head_to_be_acknowledged(
    start_server: StartServer,
) -> None:
    took_s = []
    with start_server().client() as client:
        for _ in range(40):
            began_s = time.perf_counter()
            assert client.get("/v1/health").status_code == 200
            took_s.append(time.perf_counter() - began_s)
    # Acknowledgements are delayed once a connection has sent a little; Linux delays by 40 ms at
    # least, so that then no answer whatever would be quicker.
    assert min(took_s[20:]) < 0.035
