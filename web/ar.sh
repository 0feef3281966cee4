#!/usr/bin/env bash
# The archiver of zig, which web/cc.sh compiles with.
exec "$MIMU_WEB_PYTHON" -m ziglang ar "$@"
