// Files and folders of the program, and what it reads from its standard input.
//
// A dropped file stays on the disk and is read in pieces, so that a log of a gigabyte takes no memory. Files that the program writes are in memory.

// Bytes of a dropped file that are read at a time: a read of the browser takes a fifth of a millisecond, whatever its length.
const PIECE = 1 << 20;

let inodes = 0;

/** A file that the program writes and may read again. */
export class MemoryFile {
  constructor(bytes = new Uint8Array(0)) {
    this.inode = ++inodes;
    this.bytes = bytes;
    this.size = bytes.length;
  }

  read(at, into) {
    const from = this.bytes.subarray(Math.min(at, this.size), Math.min(at + into.length, this.size));
    into.set(from);
    return from.length;
  }

  write(at, from) {
    this.resize(Math.max(this.size, at + from.length));
    this.bytes.set(from, at);
  }

  resize(size) {
    if (size > this.bytes.length) {
      const grown = new Uint8Array(Math.max(size, 2 * this.bytes.length, 4096));
      grown.set(this.bytes.subarray(0, this.size));
      this.bytes = grown;
    } else if (size < this.size) {
      this.bytes.fill(0, size, this.size);
    }
    this.size = size;
  }

  content() {
    return this.bytes.subarray(0, this.size);
  }
}

/** A file on the person's disk: read only. `heard` receives the share that has been read. */
export class DroppedFile {
  constructor(file, heard = () => {}) {
    this.inode = ++inodes;
    this.file = file;
    this.size = file.size;
    this.heard = heard;
    this.from = 0;
    this.piece = new Uint8Array(0);
  }

  read(at, into) {
    const wanted = Math.min(into.length, this.size - at);
    if (wanted <= 0) return 0;
    if (at < this.from || at >= this.from + this.piece.length) {
      this.from = at;
      const end = Math.min(at + Math.max(PIECE, wanted), this.size);
      this.piece = new Uint8Array(new FileReaderSync().readAsArrayBuffer(this.file.slice(at, end)));
      this.heard(end / this.size);
    }
    const have = this.piece.subarray(at - this.from, at - this.from + wanted);
    into.set(have);
    return have.length;
  }
}

/** Folders and files by name. */
export class Folder {
  constructor() {
    this.inode = ++inodes;
    this.entries = new Map();
  }

  /** The folder of `path` and the last name in it; `null` if a folder on the way is missing. */
  parent(path) {
    const names = path.split("/").filter((name) => name !== "" && name !== ".");
    let folder = this;
    for (const name of names.slice(0, -1)) {
      folder = folder.entries.get(name);
      if (!(folder instanceof Folder)) return null;
    }
    return [folder, names.at(-1)];
  }

  /** Paths and contents of all files that the program wrote. */
  *files(before = "") {
    for (const [name, entry] of this.entries) {
      if (entry instanceof Folder) yield* entry.files(`${before}${name}/`);
      else if (entry instanceof MemoryFile) yield [before + name, entry.content().slice()];
    }
  }

  find(path) {
    const found = this.parent(path);
    if (!found) return undefined;
    const [folder, name] = found;
    return name === undefined ? folder : folder.entries.get(name);
  }
}

/** Bytes that the program reads from its standard input; a read at their end returns nothing. */
export class Input {
  constructor() {
    this.waiting = [];
  }

  push(text) {
    this.waiting.push(new TextEncoder().encode(text));
  }

  read(_, into) {
    let sum = 0;
    while (this.waiting.length && sum < into.length) {
      const [first] = this.waiting;
      const part = first.subarray(0, into.length - sum);
      into.set(part, sum);
      sum += part.length;
      if (part.length === first.length) this.waiting.shift();
      else this.waiting[0] = first.subarray(part.length);
    }
    return sum;
  }
}
