//! The connections that may be open at one time. Whoever has no token must not be able to take them all: where none is
//! free, the oldest of those that the gate has not let pass is closed for a new one.

use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Connections at one time; more are closed.
const MOST: usize = 48;

/// All seats.
#[derive(Default)]
pub(super) struct Seats(Arc<Mutex<Taken>>);

#[derive(Default)]
struct Taken {
    /// Those taken, the oldest first.
    list: Vec<Place>,
    /// Counts all that were ever taken.
    next: u64,
}

struct Place {
    number: u64,
    /// Another handle of the connection, to close it by.
    stream: TcpStream,
    /// Whether the gate let it pass.
    passed: bool,
}

/// One of the connections that may be open; it is given back with the value.
pub struct Seat {
    taken: Arc<Mutex<Taken>>,
    number: u64,
}

fn lock(taken: &Mutex<Taken>) -> MutexGuard<'_, Taken> {
    taken.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Seats {
    /// A seat for a new connection; `None` if all are taken by such as the gate let pass, or the system has no more.
    pub fn take(&self, stream: &TcpStream) -> Option<Seat> {
        let stream = stream.try_clone().ok()?;
        let mut taken = lock(&self.0);
        if taken.list.len() >= MOST {
            let oldest = taken.list.iter().position(|place| !place.passed)?;
            // Its thread reads the end, and ends.
            let _ = taken.list.remove(oldest).stream.shutdown(Shutdown::Both);
        }
        let number = taken.next;
        taken.next += 1;
        taken.list.push(Place { number, stream, passed: false });
        Some(Seat { taken: self.0.clone(), number })
    }
}

impl Seat {
    /// The gate let the connection pass: it is not closed for another one.
    pub fn keep(&self) {
        lock(&self.taken).list.iter_mut().filter(|p| p.number == self.number).for_each(|p| p.passed = true);
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        lock(&self.taken).list.retain(|place| place.number != self.number);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn the_oldest_that_did_not_pass_makes_room_and_seats_are_given_back() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let connect = || {
            let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            (client, listener.accept().unwrap().0)
        };
        let (seats, mut clients) = (Seats::default(), Vec::new());
        let mut held: Vec<Seat> = (0..MOST)
            .map(|_| {
                let (client, server) = connect();
                clients.push((client, server.try_clone().unwrap()));
                seats.take(&server).unwrap()
            })
            .collect();
        held[0].keep();
        let (_, server) = connect();
        held.push(seats.take(&server).unwrap());
        // The second was the oldest that had not passed.
        assert_eq!(clients[1].0.read(&mut [0]).unwrap(), 0);
        clients[0].0.set_read_timeout(Some(std::time::Duration::from_millis(50))).unwrap();
        assert!(clients[0].0.read(&mut [0]).is_err(), "it is open, and nothing came");
        held.iter().for_each(Seat::keep);
        assert!(seats.take(&server).is_none());
        drop(held.pop());
        assert!(seats.take(&server).is_some());
        drop(held);
        assert!(lock(&seats.0).list.is_empty());
    }
}
