#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tessuto_fuzz::film(bytes));
