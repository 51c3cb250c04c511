"""With a certificate the console is served to other machines, under its name and over TLS alone."""

import shutil
import ssl
import subprocess
from pathlib import Path

import aiohttp
import pytest
from yarl import URL

from app.commands._options import Options
from app.core.errors import PreflightError, UsageError
from app.ui import open_console
from app.ui.server.tls import Tls
from tests.ui.test_console import PROTOCOL

pytestmark = pytest.mark.anyio

NAME = "Lab.Example"


@pytest.fixture(scope="module")
def tls(tmp_path_factory: pytest.TempPathFactory) -> Tls:
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("The program `openssl` is missing, which makes the certificate of this test.")
    folder = tmp_path_factory.mktemp("tls")
    made = Tls(certificate=folder / "cert.pem", key=folder / "key.pem", name=NAME)
    subprocess.run(
        [
            *(openssl, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", f"/CN={NAME}"),
            *("-addext", f"subjectAltName=DNS:{NAME}", "-keyout", made.key, "-out", made.certificate),
        ],
        check=True,
        capture_output=True,
    )
    return made


async def test_the_console_is_served_over_tls_under_its_name_alone(tls: Tls) -> None:
    trusting = ssl.create_default_context(cafile=str(tls.certificate))
    trusting.check_hostname = False  # The name leads nowhere here; the Host header carries it.
    async with (
        open_console(host="127.0.0.1", port=0, title="t", cell="simulated", stop=lambda: None, tls=tls) as console,
        aiohttp.ClientSession(connector=aiohttp.TCPConnector(ssl=trusting)) as session,
    ):
        url = URL(console.url)
        assert (url.scheme, url.host) == ("https", NAME.lower())
        here, host = url.with_host("127.0.0.1"), f"{url.host}:{url.port}"
        async with session.get(here, headers={"Host": host}) as reply:
            assert reply.status == 200
            assert "secure" in reply.headers["Set-Cookie"].lower()
        cookie = {"Cookie": f"dipac_{url.port}={url.query['token']}", "Host": host}
        asked = {
            f"https://{host}": 200,
            f"http://{host}": 403,
            "https://evil.example": 403,
            f"https://evil.example:{url.port}": 403,
        }
        for origin, status in asked.items():
            async with session.post(
                here.with_path("/stop").with_query({}), headers=cookie | {"Origin": origin}
            ) as reply:
                assert reply.status == status, origin
        joined = cookie | {"Origin": f"https://{host}"}
        async with session.ws_connect(here.with_query({}), protocols=[PROTOCOL], headers=joined) as websocket:
            assert websocket.protocol == PROTOCOL
        other = cookie | {"Host": "other.example"}
        async with session.get(here.with_query({}), headers=other) as reply:
            assert reply.status == 403


async def test_nobody_is_served_without_tls_where_there_is_a_certificate(tls: Tls) -> None:
    async with (
        open_console(host="127.0.0.1", port=0, title="t", cell="simulated", stop=lambda: None, tls=tls) as console,
        aiohttp.ClientSession() as session,
    ):
        with pytest.raises(aiohttp.ClientError):
            await session.get(URL(console.url).with_scheme("http").with_host("127.0.0.1"))


async def test_a_certificate_that_is_none_is_said_with_its_options(tmp_path: Path) -> None:
    (tmp_path / "cert.pem").write_text("none")
    bad = Tls(certificate=tmp_path / "cert.pem", key=tmp_path / "missing.pem", name=NAME)
    with pytest.raises(PreflightError, match=r"--tls-cert .*--tls-key"):
        bad.context()


@pytest.mark.serial
def test_a_key_with_a_passphrase_is_an_error_and_not_a_question(tls: Tls, tmp_path: Path) -> None:
    locked = tmp_path / "locked.pem"
    subprocess.run(
        ["openssl", "rsa", "-aes128", "-passout", "pass:secret", "-in", tls.key, "-out", locked],
        check=True,
        capture_output=True,
    )
    with pytest.raises(PreflightError, match="without a passphrase"):
        Tls(certificate=tls.certificate, key=locked, name=NAME).context()


async def test_half_a_certificate_is_refused(tmp_path: Path) -> None:
    assert Options().tls is None
    with pytest.raises(UsageError, match="belong together"):
        _ = Options(tls_cert=tmp_path / "cert.pem").tls
    given = Options(tls_cert=tmp_path / "c", tls_key=tmp_path / "k", tls_name=NAME).tls
    assert given == Tls(certificate=tmp_path / "c", key=tmp_path / "k", name=NAME)
