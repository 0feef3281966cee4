#!/usr/bin/env bash
# `make data`: brings the public recordings of docs/recordings.md from where they are published, into $MIMU_DATA or ../shared/data. Files that are
# there already are checked and kept; a file with another checksum is refused.
#
#     tests/data.sh [TABLE]
#
# TABLE is tests/data.txt. MIMU_DATA_FROM replaces the beginning of the addresses, as for a mirror: BASE/REPOSITORY/COMMIT/DIRECTORY/FILE.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
table=${1:-$here/data.txt}
data=${MIMU_DATA:-$here/../../shared/data}
from=${MIMU_DATA_FROM:-https://raw.githubusercontent.com}

refuse() { echo "make data: $1" >&2; exit 1; }
is_right() { [ "$(sha256sum < "$1" | cut -d' ' -f1)" = "$2" ]; }

part=
trap 'if [ -n "$part" ]; then rm -f "$part"; fi' EXIT

kept=0 brought=0 line=0
while read -r first second rest || [ -n "$first" ]; do
  line=$((line + 1))
  case $first in
    '' | '#'*) continue ;;
    set)
      folder=$second
      read -r repository commit licence directory <<< "$rest"
      [ -n "$directory" ] || refuse "$table, line $line: a set has a folder, a repository, a commit, a licence and a directory; complete it"
      continue ;;
  esac
  [ -n "${folder:-}" ] || refuse "$table, line $line: a file before the first set; write the set above it"
  sum=$first file=$second target=$data/$folder/$second
  if [ -e "$target" ]; then
    is_right "$target" "$sum" || refuse "$target: its content is not that of the published file; move it away and run this again"
    kept=$((kept + 1))
    continue
  fi
  url="$from/$repository/$commit/$directory/$file"
  mkdir -p "$data/$folder" || refuse "$data/$folder: cannot be made; set MIMU_DATA to a directory that can be written"
  part=$(mktemp "$data/$folder/.$file.XXXXXX")
  curl -fsSL --retry 3 -o "$part" "${url// /%20}" \
    || refuse "$url: cannot be read; check the network and run this again, or set MIMU_DATA_FROM to a mirror"
  is_right "$part" "$sum" || refuse "$url: its checksum is not $sum, so it is not kept; check what lies between this machine and the publisher"
  chmod 644 "$part"
  mv "$part" "$target"
  part=
  brought=$((brought + 1))
  if [ ! -e "$data/${folder%%/*}/SOURCE.txt" ]; then
    printf 'GitHub %s, commit %s\nlicence %s\n' "$repository" "$commit" "$licence" > "$data/${folder%%/*}/SOURCE.txt"
  fi
done < "$table"
echo "$data: $brought files brought, $kept were there"
