"""A browser without a window, driven by the DevTools protocol over two pipes; it needs nothing but Chromium."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

COMMAND = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
MISSING = "needs the browser Chromium (Debian's package `chromium`), which is not here"
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--hide-scrollbars", "--remote-debugging-pipe"),
)
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""WebGL by software."""
BEGIN = """import fcntl, os, sys
read, write = (fcntl.fcntl(int(number), fcntl.F_DUPFD, 10) for number in sys.argv[1:3])
os.dup2(read, 3)
os.dup2(write, 4)
os.execv(sys.argv[3], sys.argv[3:])"""
"""Becomes the browser, which reads from 3 and writes to 4."""


class Chromium:
    """One page of a browser; `errors` holds what it complained of."""

    def __init__(self, *flags: str):
        assert COMMAND
        self.folder = tempfile.mkdtemp(prefix="chromium-")
        (to_read, self.to), (self.back, to_write) = os.pipe(), os.pipe()
        chosen = (*FLAGS, f"--user-data-dir={self.folder}", *flags, "about:blank")
        self.process = subprocess.Popen(
            [sys.executable, "-S", "-c", BEGIN, str(to_read), str(to_write), COMMAND, *chosen],
            pass_fds=(to_read, to_write),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_read)
        os.close(to_write)
        self.rest, self.number, self.session, self.errors, self.events = b"", 0, "", [], []
        target = self._first_page()
        self.session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for part in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{part}.enable")

    def _first_page(self) -> str:
        for _ in range(100):
            found = [one for one in self.send("Target.getTargets")["targetInfos"] if one["type"] == "page"]
            if found:
                return found[0]["targetId"]
            time.sleep(0.05)
        raise RuntimeError("Chromium opened no page.")

    def send(self, method: str, timeout: float = 60.0, **params: Any) -> dict[str, Any]:
        """The result of a command."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        message |= {"sessionId": self.session} if self.session else {}
        os.write(self.to, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + timeout
        while True:
            answer = self._next(end)
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self._heard(answer)

    def _next(self, end: float) -> dict[str, Any]:
        while b"\0" not in self.rest:
            if not select.select([self.back], [], [], max(end - time.monotonic(), 0))[0]:
                raise TimeoutError("Chromium does not answer.")
            data = os.read(self.back, 1 << 20)
            if not data:
                raise RuntimeError("Chromium has ended.")
            self.rest += data
        line, _, self.rest = self.rest.partition(b"\0")
        return json.loads(line)

    def _heard(self, event: dict[str, Any]) -> None:
        method, params = event.get("method", ""), event.get("params", {})
        self.events.append(method)
        if method == "Runtime.exceptionThrown":
            told = params["exceptionDetails"]
            self.errors.append(told.get("exception", {}).get("description", told["text"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
            self.errors.append(" ".join(str(one.get("value", one.get("description"))) for one in params["args"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.errors.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent" and not params["request"]["url"].startswith(("file:", "data:")):
            self.errors.append(f"asks for {params['request']['url']}")

    def size(self, width: int, height: int, touch: bool = False, scale: float = 1.0) -> None:
        """Set the size of the page in CSS pixels."""
        self.send(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=touch
        )
        self.send("Emulation.setTouchEmulationEnabled", enabled=touch)

    def prefer(self, **features: str) -> None:
        """Set media features, as in prefer(prefers_color_scheme="dark")."""
        told = [{"name": name.replace("_", "-"), "value": value} for name, value in features.items()]
        self.send("Emulation.setEmulatedMedia", features=told)

    def open(self, path: Path) -> None:
        """Load a file and wait until it is there."""
        self.errors, self.events = [], []
        self.send("Page.navigate", url=path.resolve().as_uri())
        end = time.monotonic() + 60
        while "Page.loadEventFired" not in self.events:
            self._heard(self._next(end))

    def value(self, script: str) -> Any:
        """The value of a JavaScript expression, awaited; raises AssertionError where it throws."""
        told = self.send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    def frames(self, count: int = 2) -> None:
        """Wait for some frames."""
        wait = "await new Promise(done => requestAnimationFrame(done));"
        self.value(f"(async () => {{ for (let k = 0; k < {count}; k++) {wait} }})()")

    def picture(self, path: Path) -> Path:
        """Write a screenshot as PNG."""
        path.write_bytes(base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"]))
        return path

    def press(self, key: str) -> None:
        """Press and release a key."""
        text = {"text": key} if len(key) == 1 else {}
        self.send("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.send("Input.dispatchKeyEvent", type="keyUp", key=key)

    def close(self) -> None:
        """End the browser."""
        try:
            self.send("Browser.close", timeout=5)
            self.process.wait(10)
        except (RuntimeError, TimeoutError, OSError, subprocess.TimeoutExpired):
            self.process.kill()
            self.process.wait()
        os.close(self.to)
        os.close(self.back)
        shutil.rmtree(self.folder, ignore_errors=True)
