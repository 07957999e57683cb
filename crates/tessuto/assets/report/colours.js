"use strict";
/** Colour scales, as rows of sRGB bytes; those of the written images (`report/colour.rs`) look alike. */
tessuto.scales = (() => {
  const hex = text => text.match(/../g).map(h => parseInt(h, 16));
  const scale = text => text.split(" ").map(hex);
  return {
    // Viridis and a blue–red scale by Kenneth Moreland, eleven steps each.
    sequential: scale("440154 482576 414487 35608d 2a788e 21908c 22a884 43bf71 7ad151 bbdf27 fde725"),
    diverging: scale("3b4cc0 5d7ce6 82a6fb a7c5fe c9d8f0 dddddd f1cdba f7ac8e ee8468 d65244 b40426"),
    none: hex("8a8f98"),
  };
})();

/** Colour [r, g, b] in 0…255 at `t` in 0…1 of a scale. */
tessuto.colourAt = (scale, t) => {
  const x = Math.max(0, Math.min(1, t)) * (scale.length - 1), k = Math.min(Math.floor(x), scale.length - 2);
  return scale[k].map((c, i) => c + (scale[k + 1][i] - c) * (x - k));
};

/** Colours of lines, distinguished by people of any colour vision (Okabe, Ito), for light and for dark ground. */
tessuto.lineColours = dark => dark
  ? ["#56b4e9", "#e69f00", "#2fc595", "#e394bf", "#f0e442", "#ff7f45", "#b0b7c0", "#8f9bff"]
  : ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b58100", "#56b4e9", "#444c56", "#6f5bd0"];

/** The value of a custom property of the style sheet. */
tessuto.style = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Whether the page is dark, and a call whenever that changes. */
tessuto.darkness = matchMedia("(prefers-color-scheme: dark)");
