"""Headless Chromium without a network, driven over a pipe by its DevTools protocol; nothing but Python's own library.

    with Chromium() as chromium:
        page = chromium.open(pathlib.Path("report.html"))
        page.show(width=1280, colours="dark")
        page.look("document.title")
"""

import base64
import json
import os
import pathlib
import re
import select
import shutil
import subprocess
import tempfile
import time

FLAGS = [
    "--headless",
    "--no-sandbox",  # the tests run as root
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-extensions",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--remote-debugging-pipe",
]
# Seconds that one answer may take.
PATIENCE = 60


class ChromiumError(Exception):
    """Chromium is not there, did not answer, or refused."""


class Chromium:
    """A running browser; it and its profile go with the `with`."""

    def __init__(self):
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        if program is None:
            raise ChromiumError("there is no chromium; on Debian `apt-get install -y chromium`")
        self._profile = tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True)
        theirs_in, self._out = os.pipe()
        self._in, theirs_out = os.pipe()
        # Chromium reads from descriptor 3 and writes to 4; a shell puts them there.
        place = f"exec \"$@\" 3<&{theirs_in} 4>&{theirs_out}"
        self._process = subprocess.Popen(
            ["bash", "-c", place, "chromium", program, *FLAGS, f"--user-data-dir={self._profile.name}"],
            pass_fds=(theirs_in, theirs_out),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._buffer = b""
        self._asked = 0
        self.events = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            self.ask("Browser.close")
            self._process.wait(10)
        except (ChromiumError, OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        os.close(self._in)
        os.close(self._out)
        self._profile.cleanup()

    def ask(self, method, session=None, **parameters):
        """The answer to one question; events that come before it are kept."""
        self._asked += 1
        question = {"id": self._asked, "method": method, "params": parameters}
        if session is not None:
            question["sessionId"] = session
        os.write(self._out, json.dumps(question).encode() + b"\0")
        while (message := self._next(method)).get("id") != self._asked:
            self.events.append(message)
        if "error" in message:
            raise ChromiumError(f"{method}: {message['error']['message']}")
        return message["result"]

    def wait_for(self, event, session):
        """Waits until an event of a session has come."""
        while not any(m.get("method") == event and m.get("sessionId") == session for m in self.events):
            self.events.append(self._next(event))

    def _next(self, awaited):
        until = time.monotonic() + PATIENCE
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._in], [], [], max(0, until - time.monotonic()))
            part = os.read(self._in, 1 << 20) if ready else b""
            if not part:
                why = f"said nothing for {PATIENCE} s" if not ready else "ended"
                raise ChromiumError(f"Chromium {why} while {awaited} was awaited")
            self._buffer += part
        message, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(message)

    def version(self):
        return self.ask("Browser.getVersion")["product"]

    def open(self, path):
        """A file in a window of its own, its scripts switched off."""
        return Page(self, path)


class Page:
    """One file, open."""

    def __init__(self, chromium, path):
        self._chromium = chromium
        target = chromium.ask("Target.createTarget", url="about:blank")["targetId"]
        attached = chromium.ask("Target.attachToTarget", targetId=target, flatten=True)
        self._target, self._session = target, attached["sessionId"]
        for room in ("Page", "Network", "Runtime"):
            self._ask(f"{room}.enable")
        self._ask("Emulation.setScriptExecutionDisabled", value=True)
        self._address = pathlib.Path(path).resolve().as_uri()
        opened = self._ask("Page.navigate", url=self._address)
        if opened.get("errorText"):
            raise ChromiumError(f"{path}: {opened['errorText']}")
        chromium.wait_for("Page.loadEventFired", self._session)

    def _ask(self, method, **parameters):
        return self._chromium.ask(method, self._session, **parameters)

    def close(self):
        self._chromium.ask("Target.closeTarget", targetId=self._target)

    def asked_for(self):
        """What the page asked for besides itself."""
        self.look("0")  # by its answer all events before it have come
        sent = (m for m in self._chromium.events if m.get("sessionId") == self._session)
        sent = (m["params"]["request"]["url"] for m in sent if m["method"] == "Network.requestWillBeSent")
        return [address for address in sent if address.split("#")[0] != self._address]

    def show(self, width=1280, height=900, colours="light", media="screen"):
        """Lays the page out anew."""
        self._ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        scheme = {"name": "prefers-color-scheme", "value": colours}
        self._ask("Emulation.setEmulatedMedia", media=media, features=[scheme])

    def look(self, expression):
        """The value of an expression of our own in the page."""
        found = self._ask("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in found:
            raise ChromiumError(json.dumps(found["exceptionDetails"])[:2000])
        return found["result"].get("value")

    def screenshot(self, whole=False):
        """What is seen, or the whole page, as PNG."""
        shot = self._ask("Page.captureScreenshot", format="png", captureBeyondViewport=whole, **self._clip(whole))
        return base64.b64decode(shot["data"])

    def _clip(self, whole):
        if not whole:
            return {}
        size = self._ask("Page.getLayoutMetrics")["cssContentSize"]
        return {"clip": {**size, "scale": 1}}

    def pdf(self):
        """The page on A4, and how many sheets that is."""
        printed = self._ask("Page.printToPDF", paperWidth=8.27, paperHeight=11.69, preferCSSPageSize=True)
        printed = base64.b64decode(printed["data"])
        return printed, len(re.findall(rb"/Type\s*/Page\b", printed))
