"""HTTPS with files of a certificate: a real server, its page's cookie, and commands beside it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import httpx2
import pytest
from page_visits import served
from service_helpers import rigwright_here, wait_for
from stations import write_station

from common.errors import InputError
from service.client.asking import Service
from service.keys.keyfile import add_key
from service.keys.scope import Scope
from service.server import _certificate


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate for the name ``rig-pc`` alone, and its key."""
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("openssl is not installed")
    folder = tmp_path_factory.mktemp("tls")
    cert, key = folder / "cert.pem", folder / "key.pem"
    subprocess.run(
        [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1",
         "-nodes", "-days", "2", "-keyout", key, "-out", cert, "-subj", "/CN=rig-pc",
         "-addext", "subjectAltName=DNS:rig-pc"],
        check=True, capture_output=True,
    )  # fmt: skip
    return cert, key


@pytest.mark.slow
def test_a_service_with_a_certificate(
    tmp_path: Path, pair: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    cert, key = pair
    data, station = tmp_path / "data", write_station(tmp_path / "rig")
    data.mkdir()
    _, token = add_key(data, "anna", Scope.HARDWARE, None)
    monkeypatch.setenv("RIGWRIGHT_REQUIRE_KEYS", "true")
    more = ("--tls-cert", str(cert), "--tls-key", str(key))
    with served(data, station, more=more) as address:
        assert address.startswith("https://127.0.0.1:")
        monkeypatch.delenv("RIGWRIGHT_REQUIRE_KEYS")
        # On this computer the very certificate is trusted, though it is for another name.
        asked = ("rig", "status", "--station", station, "--key", token)
        wait_for(lambda: rigwright_here(*asked).returncode == 0)
        stranger = rigwright_here("rig", "status", "--server", address, "--key", token)
        assert stranger.returncode == 4
        assert "CERTIFICATE_VERIFY_FAILED" in stranger.stderr
        with httpx2.Client(verify=False, headers={"X-Rigwright": "1"}) as browser:
            answer = browser.post(f"{address}v1/sign-in", json={"key": token})
        assert "secure" in answer.headers["set-cookie"].lower()
        with pytest.raises(httpx2.HTTPError):
            httpx2.get(address.replace("https", "http"))


def test_what_is_no_pair_is_refused(tmp_path: Path, pair: tuple[Path, Path]) -> None:
    cert, key = pair
    assert _certificate(None, None) is None
    assert _certificate(cert, key) is not None
    nothing = tmp_path / "nothing.pem"
    nothing.write_text("no PEM")
    for given in ((cert, None), (None, key), (cert, cert), (key, key), (nothing, key),
                  (tmp_path / "missing", key)):  # fmt: skip
        with pytest.raises(InputError) as told:
            _certificate(*given)
        assert told.value.detail == "tls"


def test_a_certificate_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        Service("https://127.0.0.1:1", certificate=str(tmp_path / "gone"))
