//! A server of files that answers requests for ranges, as badly as a test wants it to, and counts what it sends.

use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader, Write},
    net::{TcpListener, TcpStream},
    ops::Range,
    sync::{Arc, Mutex, MutexGuard},
    thread,
};

/// What the server does, and what it has done.
#[derive(Default)]
pub(crate) struct State {
    /// The files by their paths, without the first `/`.
    pub(crate) files: BTreeMap<String, Vec<u8>>,
    /// The number of the version that `ETag` states.
    pub(crate) version: u32,
    /// Whether the version changes when points are asked for: more than a header.
    pub(crate) changes_at_points: bool,
    /// Whether there is no file any more when points are asked for.
    pub(crate) hides_points: bool,
    /// Whether every second answer is 503, a broken connection, half of the bytes, or 429, in turn.
    pub(crate) is_faulty: bool,
    /// Whether ranges are not understood: the whole file is sent.
    pub(crate) ignores_ranges: bool,
    /// Whether the answer states another range than the one that was asked for.
    pub(crate) misstates_ranges: bool,
    /// The query without which access is denied.
    pub(crate) signature: Option<String>,
    /// The paths of all requests.
    pub(crate) requests: Vec<String>,
    /// The bytes of files that were sent.
    pub(crate) bytes: u64,
}

/// The most bytes that are asked for at once of headers and tables.
const LONGEST_HEADER: usize = 16 << 10;

pub(crate) struct RangeServer {
    address: String,
    state: Arc<Mutex<State>>,
}

impl RangeServer {
    pub(crate) fn new(state: State) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let state = Arc::new(Mutex::new(state));
        let shared = state.clone();
        thread::spawn(move || {
            for stream in listener.incoming() {
                let shared = shared.clone();
                thread::spawn(move || serve(&stream.unwrap(), &shared));
            }
        });
        Self { address, state }
    }

    /// A server of one file.
    pub(crate) fn of(name: &str, content: Vec<u8>) -> Self {
        Self::new(State {
            files: BTreeMap::from([(name.to_owned(), content)]),
            ..State::default()
        })
    }

    pub(crate) fn url(&self, name: &str) -> String {
        format!("http://{}/{name}", self.address)
    }

    /// The host and the port.
    pub(crate) fn address(&self) -> &str {
        &self.address
    }

    pub(crate) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap()
    }
}

/// Answers the requests of a connection.
fn serve(stream: &TcpStream, state: &Mutex<State>) {
    let mut lines = BufReader::new(stream).lines().map_while(Result::ok);
    while let Some(first) = lines.next() {
        let head: Vec<String> = lines.by_ref().take_while(|line| !line.is_empty()).collect();
        let (target, is_head) = (
            first.split(' ').nth(1).unwrap_or_default(),
            first.starts_with("HEAD"),
        );
        let answer = answer(target, &head, &mut state.lock().unwrap());
        let (head, body) = answer.unwrap_or_default();
        let body = if is_head { &[] } else { body.as_slice() };
        let mut out = stream;
        if head.is_empty()
            || out
                .write_all(head.as_bytes())
                .and_then(|()| out.write_all(body))
                .is_err()
        {
            return;
        }
        if head.contains("Connection: close") {
            return;
        }
    }
}

/// The head and the body of the answer; `None` breaks the connection.
fn answer(target: &str, head: &[String], state: &mut State) -> Option<(String, Vec<u8>)> {
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let name = path.trim_start_matches('/').to_owned();
    state.requests.push(name.clone());
    let count = state.requests.len() as u64;
    let status = |status: &str| {
        Some((
            format!("HTTP/1.1 {status}\r\nContent-Length: 0\r\n\r\n"),
            Vec::new(),
        ))
    };
    if state
        .signature
        .as_ref()
        .is_some_and(|signature| signature != query)
    {
        return status("403 Forbidden");
    }
    let fault = if state.is_faulty { count % 8 } else { 0 };
    match fault {
        1 => return status("503 Service Unavailable"),
        3 => return None,
        7 => return status("429 Too Many Requests"),
        _ => {}
    }
    let Some(content) = state.files.get(&name) else {
        return status("404 Not Found");
    };
    let length = content.len();
    let wanted = head.iter().find_map(|line| {
        line.to_lowercase()
            .strip_prefix("range: bytes=")
            .map(range_of)
    });
    let has_points = wanted
        .as_ref()
        .is_some_and(|range| range.len() > LONGEST_HEADER);
    if has_points && state.hides_points {
        return status("404 Not Found");
    }
    state.version += u32::from(has_points && state.changes_at_points);
    let wanted = wanted.filter(|_| !state.ignores_ranges);
    let (first, range) = match wanted {
        Some(range) => {
            if range.start >= length {
                return status("416 Range Not Satisfiable");
            }
            let range = range.start..range.end.min(length);
            let stated = range.start + usize::from(state.misstates_ranges);
            let stated = format!(
                "Content-Range: bytes {stated}-{}/{length}\r\n",
                range.end - 1
            );
            (format!("HTTP/1.1 206 Partial Content\r\n{stated}"), range)
        }
        None => ("HTTP/1.1 200 OK\r\n".to_owned(), 0..length),
    };
    let version = state.version;
    let mut body = content[range.clone()].to_vec();
    let mut head = format!(
        "{first}Content-Length: {}\r\nETag: \"v{version}\"\r\n",
        body.len()
    );
    if fault == 5 {
        body.truncate(body.len() / 2);
        head += "Connection: close\r\n";
    }
    state.bytes += body.len() as u64;
    Some((head + "\r\n", body))
}

fn range_of(text: &str) -> Range<usize> {
    let (first, last) = text.trim().split_once('-').unwrap();
    first.parse().unwrap()..last.parse::<usize>().unwrap() + 1
}
