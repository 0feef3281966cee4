// The file system, the clock and the standard streams that the program expects from its system (WASI preview 1), in memory. The only directory that
// it is given is the root.

import { Folder, MemoryFile } from "./files.js";

const OK = 0, BADF = 8, EXIST = 20, INVAL = 28, ISDIR = 31, NOENT = 44, NOSYS = 52, NOTDIR = 54, NOTEMPTY = 55, ROFS = 69, SPIPE = 70;
const CHARACTER = 2, DIRECTORY = 3, REGULAR = 4;
const CREATE = 1, MUST_BE_DIRECTORY = 2, EXCLUSIVE = 4, TRUNCATE = 8, APPEND = 1;
const encoder = new TextEncoder(), decoder = new TextDecoder();

/** The program has ended by itself. */
class Exit extends Error {
  constructor(code) {
    super(`exit ${code}`);
    this.code = code;
  }
}

/**
 * Runs the program with these arguments on the files in `root`.
 * Returns its exit status and what it wrote to its standard streams. A trap of the program is thrown on. `heard(what, share)` is told how far it is.
 */
export function run(module, root, args, heard) {
  return start(module, root, args, undefined, undefined, heard)("_start");
}

/**
 * Makes an instance of the program. Returns a function that calls one of its exports by name and answers like `run`. If `said` is given, it
 * receives the lines of the standard output at once; `heard` receives the progress, which is then no part of the standard error.
 */
export function start(module, root, args, input, said, heard) {
  let memory;
  const view = () => new DataView(memory.buffer);
  const bytes = (at, length) => new Uint8Array(memory.buffer, at, length);
  const text = (at, length) => decoder.decode(bytes(at, length).slice());
  const streams = ["", ""];
  const utf8 = [new TextDecoder(), new TextDecoder()];
  const open = new Map([[0, { input }], [1, { stream: 0 }], [2, { stream: 1 }], [3, { node: root }]]);
  let next = 4;

  const vectors = (at, count) => {
    const data = view();
    return Array.from({ length: count }, (_, k) => bytes(data.getUint32(at + 8 * k, true), data.getUint32(at + 8 * k + 4, true)));
  };
  const list = (strings) => ({
    sizes(count, size) {
      view().setUint32(count, strings.length, true);
      view().setUint32(size, strings.reduce((sum, s) => sum + encoder.encode(s).length + 1, 0), true);
      return OK;
    },
    get(pointers, at) {
      strings.forEach((string, k) => {
        view().setUint32(pointers + 4 * k, at, true);
        const encoded = encoder.encode(string + "\0");
        bytes(at, encoded.length).set(encoded);
        at += encoded.length;
      });
      return OK;
    },
  });
  const kind = (handle) => (!handle.node ? CHARACTER : handle.node instanceof Folder ? DIRECTORY : REGULAR);
  const stat = (node, at) => {
    bytes(at, 64).fill(0);
    const data = view();
    data.setBigUint64(at + 8, BigInt(node?.inode ?? 0), true);
    data.setUint8(at + 16, !node ? CHARACTER : node instanceof Folder ? DIRECTORY : REGULAR);
    data.setBigUint64(at + 24, 1n, true);
    data.setBigUint64(at + 32, BigInt(node?.size ?? 0), true);
    return OK;
  };
  /** `then(folder, name, what is there)` for a path below an open folder. */
  const below = (fd, at, length, then) => {
    const from = open.get(fd)?.node;
    if (!(from instanceof Folder)) return BADF;
    const found = from.parent(text(at, length));
    if (!found) return NOENT;
    const [folder, name] = found;
    return then(folder, name, name === undefined ? folder : folder.entries.get(name));
  };
  const read = (fd, iovs, count, at, result) => {
    const handle = open.get(fd);
    if (!handle) return BADF;
    if (handle.node instanceof Folder) return ISDIR;
    let sum = 0;
    for (const into of vectors(iovs, count)) {
      const from = handle.node ?? handle.input;
      const got = from ? from.read(at + sum, into) : 0;
      sum += got;
      if (got < into.length) break;
    }
    view().setUint32(result, sum, true);
    return sum;
  };
  const write = (fd, iovs, count, at, result) => {
    const handle = open.get(fd);
    if (!handle) return BADF;
    let sum = 0;
    for (const from of vectors(iovs, count)) {
      if (handle.stream !== undefined) {
        streams[handle.stream] += utf8[handle.stream].decode(from.slice(), { stream: true });
        if (said && handle.stream === 0) hand();
        if (heard && handle.stream === 1) hear();
      } else if (handle.node instanceof MemoryFile) handle.node.write(at + sum, from);
      else return ROFS;
      sum += from.length;
    }
    view().setUint32(result, sum, true);
    return sum;
  };
  const hand = () => {
    const lines = streams[0].split("\n");
    streams[0] = lines.pop();
    lines.forEach(said);
  };
  const hear = () => {
    streams[1] = streams[1].replace(/^progress: (.*) (\d+)\n/gm, (_, what, thousandths) => {
      heard(what, Number(thousandths) / 1000);
      return "";
    });
  };
  const remove = (wantsFolder) => (fd, at, length) =>
    below(fd, at, length, (folder, name, node) => {
      if (!node) return NOENT;
      if (node instanceof Folder !== wantsFolder) return wantsFolder ? NOTDIR : ISDIR;
      if (wantsFolder && node.entries.size > 0) return NOTEMPTY;
      folder.entries.delete(name);
      return OK;
    });
  const argv = list(args), environ = list([]);

  const calls = {
    args_sizes_get: argv.sizes,
    args_get: argv.get,
    environ_sizes_get: environ.sizes,
    environ_get: environ.get,
    clock_time_get(id, _, at) {
      const ms = id === 0 ? Date.now() : performance.now();
      view().setBigUint64(at, BigInt(Math.round(ms * 1e6)), true);
      return OK;
    },
    clock_res_get(_, at) {
      view().setBigUint64(at, 1000n, true);
      return OK;
    },
    random_get(at, length) {
      for (let k = 0; k < length; k += 65536) crypto.getRandomValues(bytes(at + k, Math.min(65536, length - k)));
      return OK;
    },
    proc_exit(code) {
      throw new Exit(code);
    },
    sched_yield: () => OK,
    fd_read(fd, iovs, count, result) {
      const handle = open.get(fd);
      const got = read(fd, iovs, count, handle?.at ?? 0, result);
      if (!handle || handle.node instanceof Folder) return got;
      if (handle.node) handle.at += got;
      return OK;
    },
    fd_pread(fd, iovs, count, at, result) {
      const handle = open.get(fd);
      const got = read(fd, iovs, count, Number(at), result);
      return handle && !(handle.node instanceof Folder) ? OK : got;
    },
    fd_write(fd, iovs, count, result) {
      const handle = open.get(fd);
      if (!handle) return BADF;
      if (handle.node && !(handle.node instanceof MemoryFile)) return ROFS;
      const at = handle.append ? handle.node.size : handle.at ?? 0;
      const put = write(fd, iovs, count, at, result);
      if (handle.node) handle.at = at + put;
      return OK;
    },
    fd_pwrite(fd, iovs, count, at, result) {
      if (!(open.get(fd)?.node instanceof MemoryFile)) return ROFS;
      write(fd, iovs, count, Number(at), result);
      return OK;
    },
    fd_seek(fd, offset, whence, result) {
      const handle = open.get(fd);
      if (!handle?.node) return handle ? SPIPE : BADF;
      const at = Number(offset) + [0, handle.at, handle.node.size][whence];
      if (at < 0) return INVAL;
      handle.at = at;
      view().setBigUint64(result, BigInt(at), true);
      return OK;
    },
    fd_tell(fd, result) {
      const handle = open.get(fd);
      if (!handle?.node) return handle ? SPIPE : BADF;
      view().setBigUint64(result, BigInt(handle.at), true);
      return OK;
    },
    fd_close: (fd) => (open.delete(fd) ? OK : BADF),
    fd_sync: () => OK,
    fd_datasync: () => OK,
    fd_advise: () => OK,
    fd_allocate: () => OK,
    fd_fdstat_get(fd, at) {
      const handle = open.get(fd);
      if (!handle) return BADF;
      bytes(at, 24).fill(0);
      view().setUint8(at, kind(handle));
      view().setUint16(at + 2, handle.append ? APPEND : 0, true);
      view().setBigUint64(at + 8, ~0n & 0x1fffffffn, true);
      view().setBigUint64(at + 16, 0x1fffffffn, true);
      return OK;
    },
    fd_fdstat_set_flags: () => OK,
    fd_filestat_get: (fd, at) => (open.has(fd) ? stat(open.get(fd).node, at) : BADF),
    fd_filestat_set_size(fd, size) {
      const node = open.get(fd)?.node;
      if (!(node instanceof MemoryFile)) return ROFS;
      node.resize(Number(size));
      return OK;
    },
    fd_filestat_set_times: () => OK,
    fd_prestat_get(fd, at) {
      if (fd !== 3) return BADF;
      view().setUint32(at, 0, true);
      view().setUint32(at + 4, 1, true);
      return OK;
    },
    fd_prestat_dir_name(_, at) {
      bytes(at, 1).set([47]);
      return OK;
    },
    fd_readdir(fd, at, length, cookie, result) {
      const node = open.get(fd)?.node;
      if (!(node instanceof Folder)) return BADF;
      let used = 0, k = 0;
      for (const [name, entry] of node.entries) {
        k += 1;
        if (k <= Number(cookie)) continue;
        const encoded = encoder.encode(name);
        const record = new Uint8Array(24 + encoded.length);
        const data = new DataView(record.buffer);
        data.setBigUint64(0, BigInt(k), true);
        data.setBigUint64(8, BigInt(entry.inode), true);
        data.setUint32(16, encoded.length, true);
        data.setUint8(20, entry instanceof Folder ? DIRECTORY : REGULAR);
        record.set(encoded, 24);
        const part = record.subarray(0, length - used);
        bytes(at + used, part.length).set(part);
        used += part.length;
        if (used === length) break;
      }
      view().setUint32(result, used, true);
      return OK;
    },
    path_open(fd, _, at, length, how, rights, inheriting, flags, result) {
      return below(fd, at, length, (folder, name, node) => {
        if (node && how & CREATE && how & EXCLUSIVE) return EXIST;
        if (!node && !(how & CREATE)) return NOENT;
        if (how & MUST_BE_DIRECTORY && !(node instanceof Folder)) return NOTDIR;
        if (!node) folder.entries.set(name, (node = new MemoryFile()));
        if (how & TRUNCATE) {
          if (!(node instanceof MemoryFile)) return ROFS;
          node.resize(0);
        }
        open.set(next, { node, at: 0, append: Boolean(flags & APPEND) });
        view().setUint32(result, next++, true);
        return OK;
      });
    },
    path_filestat_get: (fd, _, at, length, result) => below(fd, at, length, (__, ___, node) => (node ? stat(node, result) : NOENT)),
    path_filestat_set_times: () => OK,
    path_create_directory: (fd, at, length) =>
      below(fd, at, length, (folder, name, node) => {
        if (node) return EXIST;
        folder.entries.set(name, new Folder());
        return OK;
      }),
    path_remove_directory: remove(true),
    path_unlink_file: remove(false),
    path_rename: (fd, at, length, to, toAt, toLength) =>
      below(fd, at, length, (folder, name, node) => {
        if (!node) return NOENT;
        return below(to, toAt, toLength, (other, newName, there) => {
          if (there instanceof Folder && there.entries.size > 0) return NOTEMPTY;
          folder.entries.delete(name);
          other.entries.set(newName, node);
          return OK;
        });
      }),
    // A hard link makes a temporary file permanent without overwriting.
    path_link: (fd, _, at, length, to, toAt, toLength) =>
      below(fd, at, length, (__, ___, node) => {
        if (!node) return NOENT;
        return below(to, toAt, toLength, (other, name, there) => {
          if (there) return EXIST;
          other.entries.set(name, node);
          return OK;
        });
      }),
    path_readlink: () => INVAL,
    path_symlink: () => NOSYS,
    // A sleep ends at once: nothing here waits for anything outside.
    poll_oneoff(from, to, count, result) {
      for (let k = 0; k < count; k++) {
        bytes(to + 32 * k, 32).fill(0);
        bytes(to + 32 * k, 8).set(bytes(from + 48 * k, 8));
      }
      view().setUint32(result, count, true);
      return OK;
    },
  };
  const unknown = { get: (target, name) => target[name] ?? (() => NOSYS), has: () => true };
  const instance = new WebAssembly.Instance(module, { wasi_snapshot_preview1: new Proxy(calls, unknown) });
  memory = instance.exports.memory;
  return (name) => {
    let status = 0;
    try {
      status = instance.exports[name]() ?? 0;
    } catch (stopped) {
      if (!(stopped instanceof Exit)) {
        stopped.stderr = streams[1];
        throw stopped;
      }
      status = stopped.code;
    }
    return { status, stdout: streams[0], stderr: streams[1], memory: memory.buffer.byteLength };
  };
}
