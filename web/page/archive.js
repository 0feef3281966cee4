// A session's folder as a ZIP archive, which every system opens, and back. Written without compression, because a command or this page reads it
// again.

const LOCAL = 0x04034b50, CENTRAL = 0x02014b50, END = 0x06054b50, STORED = 0, DEFLATED = 8, UTF8 = 1 << 11;
/** The first day of the format: the files contain their own times. */
const DATE = (1 << 5) | 1;

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; k++) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
  return n;
});

function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) crc = TABLE[(crc ^ byte) & 255] ^ (crc >>> 8);
  return ~crc >>> 0;
}

/** The archive of `files`, a map from paths to bytes. */
export function zip(files) {
  const parts = [], directory = [];
  let at = 0, size = 0;
  for (const [path, bytes] of files) {
    const name = new TextEncoder().encode(path);
    // Fields of a file that both headers contain: version, flags, method, time, date, check, sizes, length of the name.
    const said = new DataView(new ArrayBuffer(26));
    [[0, 20], [2, UTF8], [4, STORED], [8, DATE], [22, name.length]].forEach(([where, value]) => said.setUint16(where, value, true));
    [[10, crc32(bytes)], [14, bytes.length], [18, bytes.length]].forEach(([where, value]) => said.setUint32(where, value, true));
    const local = new Uint8Array(30), central = new Uint8Array(46);
    new DataView(local.buffer).setUint32(0, LOCAL, true);
    local.set(new Uint8Array(said.buffer), 4);
    const view = new DataView(central.buffer);
    view.setUint32(0, CENTRAL, true);
    view.setUint16(4, 20, true);
    central.set(new Uint8Array(said.buffer), 6);
    view.setUint32(42, at, true);
    parts.push(local, name, bytes);
    directory.push(central, name);
    at += local.length + name.length + bytes.length;
    size += central.length + name.length;
  }
  const end = new DataView(new ArrayBuffer(22));
  end.setUint32(0, END, true);
  end.setUint16(8, files.size, true);
  end.setUint16(10, files.size, true);
  end.setUint32(12, size, true);
  end.setUint32(16, at, true);
  return new Blob([...parts, ...directory, end.buffer], { type: "application/zip" });
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The files of an archive, as a map from paths to bytes; `null` if it cannot be read. */
export async function unzip(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  // A comment of any length follows the end record.
  let end = bytes.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== END) end--;
  if (end < 0) return null;
  const files = new Map();
  try {
    let at = view.getUint32(end + 16, true);
    for (let left = view.getUint16(end + 10, true); left > 0; left--) {
      if (view.getUint32(at, true) !== CENTRAL) return null;
      const [method, packed, name, extra, comment, local] = [
        view.getUint16(at + 10, true), view.getUint32(at + 20, true), view.getUint16(at + 28, true),
        view.getUint16(at + 30, true), view.getUint16(at + 32, true), view.getUint32(at + 42, true),
      ];
      const path = new TextDecoder().decode(bytes.subarray(at + 46, at + 46 + name));
      const from = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
      const content = bytes.subarray(from, from + packed);
      const check = view.getUint32(at + 16, true);
      at += 46 + name + extra + comment;
      if (path.endsWith("/")) continue;
      if (method !== STORED && method !== DEFLATED) return null;
      const whole = method === STORED ? content : await inflated(content);
      if (crc32(whole) !== check) return null;
      files.set(path, whole);
    }
  } catch {
    // An offset that leads out of the file, or a stream that is cut.
    return null;
  }
  return files;
}
