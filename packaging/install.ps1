# Installs the command `mimu` for Windows from the archive of a release, whose SHA-256 is checked. The release's workflow writes its version and
# address into this file. Usage: install.ps1 [FOLDER]; by default into the user's programs.
param([string]$To = "$env:LOCALAPPDATA\Programs\mimu")
$ErrorActionPreference = "Stop"
$version = "@VERSION@"
$from = if ($env:MIMU_FROM) { $env:MIMU_FROM } else { "@ADDRESS@/releases/download/v$version" }
$name = "mimu-$version-x86_64-pc-windows-msvc"
$folder = Join-Path ([IO.Path]::GetTempPath()) ([Guid]::NewGuid())
New-Item -ItemType Directory $folder | Out-Null
try {
    Invoke-WebRequest "$from/$name.tar.gz" -OutFile "$folder\$name.tar.gz" -UseBasicParsing
    Invoke-WebRequest "$from/SHA256SUMS" -OutFile "$folder\SHA256SUMS" -UseBasicParsing
    $line = Get-Content "$folder\SHA256SUMS" | Where-Object { $_ -match " $([Regex]::Escape($name)).tar.gz$" }
    $hash = (Get-FileHash "$folder\$name.tar.gz" -Algorithm SHA256).Hash
    if (-not $line -or $line.Split(" ")[0] -ne $hash) { throw "the archive is not the one that SHA256SUMS lists" }
    tar -xzf "$folder\$name.tar.gz" -C $folder
    New-Item -ItemType Directory -Force $To | Out-Null
    Copy-Item "$folder\$name\mimu.exe" $To
    & "$To\mimu.exe" --version
    if (($env:PATH -split ";") -notcontains $To) { Write-Output "$To is not on the PATH: add it" }
} finally {
    Remove-Item -Recurse -Force $folder
}
