#!/usr/bin/env python3
"""Makes the zip of a package.

    package_zip.py FOLDER OUT.zip

Takes the files below FOLDER/caustique-*, under their names relative to FOLDER. Equal files give equal zips: their dates are SOURCE_DATE_EPOCH.
"""

import os
import sys
import time
import zipfile
from pathlib import Path


def main():
    folder = Path(sys.argv[1])
    date = time.gmtime(int(os.environ.get("SOURCE_DATE_EPOCH", 1700000000)))[:6]
    with zipfile.ZipFile(sys.argv[2], "w") as archive:
        for path in sorted(path for path in folder.glob("caustique-*/**/*") if path.is_file()):
            archive.writestr(zipfile.ZipInfo(str(path.relative_to(folder)), date), path.read_bytes(), zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main()
