# Homebrew's formula. packaging/assets.sh fills in version, address and hashes, and the release has the result.
class Mimu < Formula
  desc "Calibrate inertial units: gyroscopes, accelerometers and magnetometers"
  homepage "@ADDRESS@"
  version "@VERSION@"
  license any_of: ["MIT", "Apache-2.0"]

  on_macos do
    on_arm do
      url "@ADDRESS@/releases/download/v@VERSION@/mimu-@VERSION@-aarch64-apple-darwin.tar.gz"
      sha256 "@SHA256 aarch64-apple-darwin@"
    end
    on_intel do
      url "@ADDRESS@/releases/download/v@VERSION@/mimu-@VERSION@-x86_64-apple-darwin.tar.gz"
      sha256 "@SHA256 x86_64-apple-darwin@"
    end
  end

  on_linux do
    on_arm do
      url "@ADDRESS@/releases/download/v@VERSION@/mimu-@VERSION@-aarch64-unknown-linux-gnu.tar.gz"
      sha256 "@SHA256 aarch64-unknown-linux-gnu@"
    end
    on_intel do
      url "@ADDRESS@/releases/download/v@VERSION@/mimu-@VERSION@-x86_64-unknown-linux-gnu.tar.gz"
      sha256 "@SHA256 x86_64-unknown-linux-gnu@"
    end
  end

  def install
    bin.install "mimu"
    man1.install Dir["man/man1/*"]
    bash_completion.install "completions/mimu.bash" => "mimu"
    zsh_completion.install "completions/mimu.zsh" => "_mimu"
    fish_completion.install "completions/mimu.fish"
  end

  test do
    assert_match version.to_s, shell_output("#{bin}/mimu --version")
    assert_match "mimu", shell_output("#{bin}/mimu fit missing.csv 2>&1", 1)
  end
end
