//! Images and page of a result.

mod page;
