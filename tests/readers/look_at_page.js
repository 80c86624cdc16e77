// What a reader of a page would stumble over, as a list of texts. Evaluated in the page by check_pages.py, in each layout.
(() => {
  const problems = [];
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const short = (text) => text.replace(/\s+/g, " ").trim().slice(0, 60);

  const where = (element) => {
    const section = element.closest("section, header, footer");
    const inside = section ? ` in ${section.id || section.localName}` : "";
    const named = element.getAttribute("class") ? `.${element.getAttribute("class").replace(/ /g, ".")}` : "";
    return `<${element.localName}${named}>${inside} "${short(element.textContent)}"`;
  };
  const tell = (what, element) => problems.push(`${what}: ${where(element)}`);

  // What is folded away is read too.
  all("details").forEach((details) => { details.open = true; });
  const isSeen = (element) => element.checkVisibility({ visibilityProperty: true }) && element.getClientRects().length > 0;

  // Nothing runs, and nothing comes from elsewhere.
  all("script").forEach((element) => tell("a script", element));
  for (const element of all("*")) {
    for (const { name, value } of element.attributes) {
      // A page of the same lake is led to by its place beside this one, and is not needed.
      const isBeside = element.localName === "a" && /^(\.\.\/)*[\w.%-]+(\/[\w.%-]+)*\.html$/.test(value);
      const isOwn = value.startsWith("#") || value.startsWith("data:") || isBeside;
      if (name.startsWith("on")) tell(`a script in ${name}`, element);
      if (["href", "xlink:href", "src", "srcset", "action", "poster"].includes(name) && !isOwn) {
        tell(`${name} leads out of the page, to ${short(value)}`, element);
      }
    }
  }
  for (const element of all("style")) {
    if (/url\(|@import/.test(element.textContent)) tell("a style that loads something", element);
  }

  // Structure: language, title, ids, anchors, headings in order.
  if (!document.documentElement.lang) problems.push("the page names no language");
  if (!document.title.trim()) problems.push("the page has no title");
  const ids = new Set();
  for (const element of all("[id]")) {
    if (ids.has(element.id)) tell(`the id ${element.id} twice`, element);
    ids.add(element.id);
  }
  for (const link of all("a[href^='#']")) {
    if (!ids.has(link.getAttribute("href").slice(1))) tell(`a link to ${link.getAttribute("href")}, which is not there`, link);
  }
  let level = 0;
  for (const heading of all("h1, h2, h3, h4, h5, h6")) {
    const own = Number(heading.localName[1]);
    if (own > level + 1) tell(`a heading of level ${own} after one of level ${level}`, heading);
    level = own;
  }
  if (all("h1").length !== 1) problems.push(`${all("h1").length} headings of level 1`);

  // The verdict is what is read first.
  const verdict = document.querySelector("h1");
  if (verdict) {
    const before = all("section, table, svg, nav").some((element) => element.compareDocumentPosition(verdict) & 4);
    if (before || verdict.getBoundingClientRect().top + scrollY > 200) tell("the verdict does not come first", verdict);
  }

  // Charts and pictures have words, and a size.
  for (const chart of all("svg")) {
    const title = chart.querySelector(":scope > title");
    const name = chart.getAttribute("aria-label") || (title && title.textContent.trim());
    if (chart.getAttribute("role") !== "img") tell("a chart without the role img", chart);
    if (!name) tell("a chart without a name", chart);
    const { width, height } = chart.getBoundingClientRect();
    const marks = all("path", chart).filter((mark) => !mark.closest(".legend, .grid, .axis, .limit"));
    const hasExtent = ({ width, height }) => width + height > 0;
    if (!marks.some((mark) => hasExtent(mark.getBBox()))) tell("a chart with nothing drawn in it", chart);
    if (width < 40 || height < 40) tell(`a chart of ${Math.round(width)} by ${Math.round(height)} pixels`, chart);
  }
  for (const picture of all("img")) {
    if (!picture.getAttribute("alt")) tell("a picture without words", picture);
  }
  for (const table of all("table")) {
    if (!table.querySelector("th")) tell("a table without headings", table);
  }

  // The width: nothing sticks out, but what scrolls by itself.
  const root = document.documentElement;
  const scrolls = (element) => element !== null && element !== document.body && element !== root
    && (["auto", "scroll", "hidden", "clip"].includes(getComputedStyle(element).overflowX) || scrolls(element.parentElement));
  if (root.scrollWidth > root.clientWidth) {
    problems.push(`the page is ${root.scrollWidth} pixels wide where there are ${root.clientWidth}`);
    const wide = all("body *").filter((element) => element.getBoundingClientRect().right > root.clientWidth + 1);
    wide.filter((element) => !scrolls(element)).slice(0, 5).forEach((element) => tell("sticks out", element));
  }

  for (const element of all("body *").filter((own) => own.scrollWidth > own.clientWidth + 1)) {
    const isScroller = ["auto", "scroll"].includes(getComputedStyle(element).overflowX);
    if (isScroller && element.tabIndex < 0) tell("a part that keys cannot scroll", element);
  }

  // Contrast, by the colours as computed.
  const colour = (text) => {
    const numbers = (text.match(/-?[\d.]+(e-?\d+)?/g) || ["0", "0", "0", "0"]).map(Number);
    const scale = text.startsWith("color(") ? 255 : 1;
    return { rgb: numbers.slice(0, 3).map((part) => part * scale), a: numbers.length > 3 ? numbers[3] : 1 };
  };
  const over = (top, alpha, bottom) => top.map((part, i) => alpha * part + (1 - alpha) * bottom[i]);
  const luminance = (rgb) => {
    const linear = rgb.map((part) => part / 255).map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const contrast = (a, b) => {
    const [light, dark] = [luminance(a), luminance(b)].sort((x, y) => y - x);
    return (light + 0.05) / (dark + 0.05);
  };
  const canvas = document.createElement("p");
  canvas.style.background = "Canvas";
  document.body.append(canvas);
  const blank = colour(getComputedStyle(canvas).backgroundColor).rgb;
  canvas.remove();
  const ground = (element) => {
    if (element === null) return blank;
    const { rgb, a } = colour(getComputedStyle(element).backgroundColor);
    return a >= 1 ? rgb : over(rgb, a, ground(element.parentElement));
  };
  const opacity = (element) => (element === null ? 1 : Number(getComputedStyle(element).opacity) * opacity(element.parentElement));
  const painted = (element, property) => {
    const style = getComputedStyle(element);
    if (style[property] === "none") return null;
    const { rgb, a } = colour(style[property]);
    const own = property === "color" ? 1 : Number(style[`${property}Opacity`]);
    const alpha = a * own * opacity(element);
    return { ratio: contrast(over(rgb, alpha, ground(element)), ground(element)) };
  };
  const told = new Set();
  // Legible if one of the ways in which it is painted is.
  const legible = (element, properties, least, what) => {
    const ways = properties.map((property) => painted(element, property)).filter((paint) => paint !== null);
    const best = Math.max(...ways.map((paint) => paint.ratio));
    const key = [what, element.getAttribute("class"), best.toFixed(2)].join();
    if (ways.length === 0 || best >= least || told.has(key)) return;
    told.add(key);
    tell(`${what} with a contrast of ${best.toFixed(2)}, ${least} is the least`, element);
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const drawn = ["svg", "title", "desc", "style", "script"];
  while (texts.nextNode()) {
    const element = texts.currentNode.parentElement;
    if (!texts.currentNode.textContent.trim() || drawn.includes(element.localName) || !isSeen(element)) continue;
    legible(element, [element instanceof SVGElement ? "fill" : "color"], 4.5, "text");
  }
  // Marks of a chart; grid and axes, and areas behind what matters, may be faint.
  for (const mark of all("svg path, svg circle, svg rect, svg line").filter(isSeen)) {
    if (mark.matches(".grid, .axis, .band, .station")) continue;
    legible(mark, ["stroke", "fill"], 3, "a mark");
  }

  // Writing in charts: large enough, inside, and not over other writing.
  for (const chart of all("svg").filter(isSeen)) {
    const paper = chart.getBoundingClientRect();
    const view = chart.viewBox.baseVal;
    const scale = view && view.width ? paper.width / view.width : 1;
    const written = all("text", chart).filter((text) => text.textContent.trim() && isSeen(text));
    const boxes = written.map((text) => {
      const { left, right, top, bottom } = text.getBoundingClientRect();
      const trim = 0.2 * (bottom - top);
      return { text, left, right, top: top + trim, bottom: bottom - trim };
    });
    // 8 pixels are 6 points, on paper the least that journals print.
    const size = (text) => scale * parseFloat(getComputedStyle(text).fontSize);
    const tiny = written.find((text) => size(text) < 8);
    if (tiny) tell(`writing of ${size(tiny).toFixed(1)} pixels in the chart "${short(chart.textContent)}"`, tiny);
    for (const { text, left, right, top, bottom } of boxes) {
      if (left < paper.left - 1 || right > paper.right + 1 || top < paper.top - 1 || bottom > paper.bottom + 1) {
        tell(`writing that leaves the chart "${short(chart.textContent)}"`, text);
      }
    }
    const samples = all(".legend path", chart).map((sample) => sample.getBoundingClientRect());
    for (const { text, left, right, top, bottom } of boxes.filter(({ text }) => text.closest(".legend"))) {
      const isOver = (sample) => sample.left < right + 2 && sample.right > left && sample.top < bottom && sample.bottom > top;
      if (samples.some(isOver)) tell(`a legend that runs into the next name in the chart "${short(chart.textContent)}"`, text);
    }
    boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => {
      const [across, down] = [Math.min(a.right, b.right) - Math.max(a.left, b.left), Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top)];
      if (across > 1 && down > 1) tell(`writing over "${short(b.text.textContent)}" in the chart "${short(chart.textContent)}"`, a.text);
    }));
  }
  return problems;
})()
