//! Loops over all cores whose results come in the order of the items.
//!
//! What rayon needs for a loop is compiled anew for each closure and each type of result, a tenth of what there is to
//! compile; here it is compiled once, and closures are called through a pointer. Meant for items that take
//! microseconds: frames, tiles, tracks. The loops over vertices and texels of the hot kernels use rayon itself.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

/// Does `work` for every number below `count`.
#[inline(never)]
pub fn each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// `work` of every number below `count`. Shape `[count]`.
pub fn map<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    map_by(count, &work)
}

fn map_by<T: Send>(count: usize, work: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    let done: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    each(count, &|k| *done[k].lock().unwrap_or_else(PoisonError::into_inner) = Some(work(k)));
    let result = |slot: Mutex<Option<T>>| slot.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.into_iter().map(|slot| result(slot).expect("each number was worked on")).collect()
}

/// As [`map`], with a scratch of `new` that `work` may leave in any state. Shape `[count]`.
pub fn map_with<S: Send, T: Send>(
    count: usize,
    new: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize) -> T + Sync,
) -> Vec<T> {
    let unused = Mutex::new(Vec::new());
    let pool = || unused.lock().unwrap_or_else(PoisonError::into_inner);
    map_by(count, &|k| {
        let free = pool().pop();
        let mut scratch = free.unwrap_or_else(&new);
        let result = work(&mut scratch, k);
        pool().push(scratch);
        result
    })
}

/// `work` of every item, which is used up, and its number. Shape `[items]`.
pub fn consume<I: Send, T: Send>(items: Vec<I>, work: impl Fn(usize, I) -> T + Sync) -> Vec<T> {
    let items: Vec<Mutex<Option<I>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    map_by(items.len(), &|k| {
        let item = items[k].lock().unwrap_or_else(PoisonError::into_inner).take();
        work(k, item.expect("each number comes once"))
    })
}

/// `work` of every item. Shape `[items]`.
pub fn over<I: Sync, T: Send>(items: &[I], work: impl Fn(&I) -> T + Sync) -> Vec<T> {
    map_by(items.len(), &|k| work(&items[k]))
}

/// `work` of every item and its number. Shape `[items]`.
pub fn numbered<I: Sync, T: Send>(items: &[I], work: impl Fn((usize, &I)) -> T + Sync) -> Vec<T> {
    map_by(items.len(), &|k| work((k, &items[k])))
}

/// As [`numbered`], of all items but the first: the template's frame, which is known. Shape `[items − 1]`.
pub fn later<I: Sync, T: Send>(items: &[I], work: impl Fn((usize, &I)) -> T + Sync) -> Vec<T> {
    map_by(items.len().saturating_sub(1), &|k| work((k + 1, &items[k + 1])))
}

/// What `work` finds of the numbers below `count`, in their order. Shape `[found]`.
pub fn filter_map<T: Send>(count: usize, work: impl Fn(usize) -> Option<T> + Sync) -> Vec<T> {
    map_by(count, &work).into_iter().flatten().collect()
}

/// `work` of every number below `count`, or the error of the first that fails.
///
/// # Errors
/// Those of `work`.
pub fn try_map<T: Send, E: Send>(
    count: usize,
    work: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    map_by(count, &work).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_items() {
        let items: Vec<usize> = (0..1000).rev().collect();
        assert_eq!(map(1000, |k| k * k), (0..1000).map(|k| k * k).collect::<Vec<_>>());
        assert_eq!(over(&items, |i| i + 1), (1..=1000).rev().collect::<Vec<_>>());
        assert!(numbered(&items, |(k, i)| k + i).iter().all(|sum| *sum == 999));
        assert_eq!(later(&items, |(k, _)| k), (1..1000).collect::<Vec<_>>());
        assert_eq!(later(&[0; 0], |(k, _)| k), [0; 0]);
        assert_eq!(filter_map(10, |k| (k % 3 == 0).then_some(k)), [0, 3, 6, 9]);
    }

    #[test]
    fn a_scratch_is_used_by_one_item_at_a_time() {
        let sums = map_with(500, Vec::new, |scratch, k| {
            scratch.clear();
            scratch.extend(0..k);
            scratch.iter().sum::<usize>()
        });
        assert!(sums.iter().enumerate().all(|(k, sum)| 2 * sum + k == k * k));
    }

    #[test]
    fn items_can_be_changed_and_used_up() {
        let mut items = vec![1; 100];
        consume(items.iter_mut().collect(), |k, item: &mut usize| *item += k);
        assert!(items.iter().enumerate().all(|(k, item)| *item == k + 1));
        let names: Vec<String> = items.iter().map(|i| i.to_string()).collect();
        assert_eq!(consume(names, |k, name| name + &k.to_string())[7], "87");
    }

    #[test]
    fn of_several_errors_the_first_counts() {
        assert_eq!(try_map(1000, |k| if k % 300 == 299 { Err(k) } else { Ok(k) }), Err(299));
        assert_eq!(try_map(3, Ok::<usize, ()>), Ok(vec![0, 1, 2]));
    }
}
