#!/usr/bin/env bash
exec "$MIMU_WEB_PYTHON" -m ziglang ar "$@"
