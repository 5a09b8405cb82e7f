#!/bin/sh
# Build the page of the studio into src/scan2nurbs/studio/static, and record of which source. PYTHON says which Python.
set -eu
cd "$(dirname "$0")"
PYTHON="${PYTHON:-python3}"
export PYTHONPATH="$PWD/../src${PYTHONPATH:+:$PYTHONPATH}"
"$PYTHON" -m scan2nurbs.studio.typescript src/messages.ts
[ -d node_modules ] || npm ci --no-audit --no-fund
npx tsc --noEmit
npx vite build
"$PYTHON" -m scan2nurbs.studio.sources
