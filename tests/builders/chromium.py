"""A browser for pages."""

import os
import shutil

import pytest

FLAGS = (
    "headless=new no-sandbox disable-quic no-first-run disable-background-networking disable-component-update "
    "disable-sync window-size=1400,1000 force-device-scale-factor=1"
)


def chromium(profile, *flags):
    """Headless Chromium with a profile and more flags; skips where there is none, and nobody says that there is."""
    found, driver = shutil.which("chromium"), shutil.which("chromedriver")
    # Where CI has found a browser nothing excuses not to use it.
    if not os.environ.get("VIEWCELL_BROWSER"):
        pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
        if not (found and driver):
            pytest.skip("no chromium and chromedriver found")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = found
    for flag in [*FLAGS.split(), *flags, f"user-data-dir={profile}"]:
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options=options, service=Service(driver))
    yield browser
    browser.quit()
