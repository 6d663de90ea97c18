#!/usr/bin/env python3
"""A mount of a directory that sees what others change late, as a client of NFS does.

    scripts/nfs/late.py DIRECTORY MOUNTPOINT SECONDS

Two mounts of one directory are two clients, and the directory is their server:

- Attributes (length, times, existence and absence alike) and listings are remembered for SECONDS. What other mounts
  create, remove or let grow shows only when they are asked for again after that.
- Opening a file asks the server for its attributes (close-to-open consistency). A read ends at the length that is known.
- Written bytes stay with the client until the file is flushed, closed, or looked at by the client itself.
- What a client itself changes it sees at once. Exclusive creation, renaming and removal are decided by the server.
- Locks (flock) are those of one client: others do not see them, as with the option `nolock` of NFS.

Needs fusepy, libfuse 2 and /dev/fuse. Runs until it is unmounted.
"""

import errno, os, sys, threading, time

from fuse import FUSE, FuseOSError, Operations


class LateSight(Operations):
    use_ns = True

    def __init__(self, directory, seconds):
        self.directory, self.seconds = directory, seconds
        self.guard = threading.RLock()
        self.known = {}  # path: (moment, attributes or the number of an error)
        self.listings = {}  # path: (moment, names)
        self.unwritten = {}  # path: [(handle, position, bytes)]

    def __call__(self, operation, *arguments):
        with self.guard:
            try:
                return getattr(self, operation)(*arguments)
            except FuseOSError:
                raise
            except OSError as error:
                raise FuseOSError(error.errno or errno.EIO)

    def real(self, path):
        return os.path.join(self.directory, path.lstrip("/"))

    # What the client remembers.

    def ask(self, path):
        """Asks the server for the attributes of a path, and remembers the answer."""
        try:
            found = os.lstat(self.real(path))
            answer = {name: getattr(found, name) for name in
                      ("st_mode", "st_nlink", "st_uid", "st_gid", "st_size", "st_blocks")}
            answer.update({name: getattr(found, f"{name}_ns") for name in ("st_atime", "st_mtime", "st_ctime")})
        except OSError as error:
            answer = error.errno
        self.known[path] = (time.monotonic(), answer)
        return answer

    def attributes(self, path):
        moment, answer = self.known.get(path, (None, None))
        if moment is None or time.monotonic() - moment > self.seconds:
            answer = self.ask(path)
        return answer

    def changed(self, *paths):
        """Forgets paths that this client has changed, and the listings that contain them."""
        for path in paths:
            self.known.pop(path, None)
            self.listings.pop(path, None)
            self.listings.pop(os.path.dirname(path), None)

    def send(self, path):
        """Sends the bytes that were written to a file to the server."""
        pieces = self.unwritten.pop(path, [])
        for handle, position, data in pieces:
            os.pwrite(handle, data, position)
        if pieces:
            self.ask(path)

    # What a file system is asked.

    def getattr(self, path, handle=None):
        self.send(path)
        answer = self.attributes(path)
        if isinstance(answer, int):
            raise FuseOSError(answer)
        return answer

    def access(self, path, mode):
        self.getattr(path)

    def readdir(self, path, handle):
        moment, names = self.listings.get(path, (None, None))
        if moment is None or time.monotonic() - moment > self.seconds:
            names = os.listdir(self.real(path))
            self.listings[path] = (time.monotonic(), names)
        return [".", "..", *names]

    def statfs(self, path):
        found = os.statvfs(self.real(path))
        return {name: getattr(found, name) for name in dir(found) if name.startswith("f_") and name != "f_fsid"}

    def open(self, path, info):
        handle = os.open(self.real(path), info.flags & ~(os.O_APPEND | os.O_CREAT | os.O_EXCL))
        self.ask(path)
        info.fh, info.direct_io = handle, 1
        return 0

    def create(self, path, mode, info):
        try:
            handle = os.open(self.real(path), info.flags & ~os.O_APPEND | os.O_CREAT, mode)
        except OSError:
            self.ask(path)
            raise
        self.changed(path)
        info.fh, info.direct_io = handle, 1
        return 0

    def read(self, path, count, position, info):
        self.send(path)
        answer = self.attributes(path)
        length = answer["st_size"] if isinstance(answer, dict) else 0
        return os.pread(info.fh, max(min(count, length - position), 0), position)

    def write(self, path, data, position, info):
        self.unwritten.setdefault(path, []).append((info.fh, position, bytes(data)))
        return len(data)

    def flush(self, path, info):
        self.send(path)
        return 0

    def fsync(self, path, datasync, info):
        self.send(path)
        os.fsync(info.fh)
        return 0

    def fsyncdir(self, path, datasync, handle):
        return 0

    def release(self, path, info):
        self.send(path)
        os.close(info.fh)
        return 0

    def truncate(self, path, length, info=None):
        self.send(path)
        os.truncate(self.real(path) if info is None else info.fh, length)
        self.ask(path)

    def utimens(self, path, times=None):
        self.send(path)
        os.utime(self.real(path), ns=times) if times else os.utime(self.real(path))
        self.ask(path)

    def chmod(self, path, mode):
        os.chmod(self.real(path), mode)
        self.changed(path)

    def chown(self, path, user, group):
        os.chown(self.real(path), user, group)
        self.changed(path)

    def mkdir(self, path, mode):
        os.mkdir(self.real(path), mode)
        self.changed(path)

    def rmdir(self, path):
        os.rmdir(self.real(path))
        self.changed(path)

    def unlink(self, path):
        self.changed(path)
        os.unlink(self.real(path))

    def rename(self, old, new):
        self.send(old)
        self.changed(old, new)
        os.rename(self.real(old), self.real(new))
        moved = self.unwritten.pop(old, None)
        if moved:
            self.unwritten[new] = moved

    def link(self, new, old):
        self.changed(new, old)
        os.link(self.real(old), self.real(new))


def main():
    directory, mountpoint, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
    # The kernel itself remembers nothing.
    FUSE(LateSight(os.path.realpath(directory), seconds), mountpoint, foreground=True, raw_fi=True, big_writes=True,
         attr_timeout=0, entry_timeout=0, negative_timeout=0, max_read=131072, allow_other=True)


main()
