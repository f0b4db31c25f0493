// Comforts of the page: copying, questions, progress, search. The page can be read and used without any of them.
// Nothing is sent anywhere; what is remembered stays in this browser.
"use strict";
(() => {
  const STORE = "lab2-worksheet";
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const one = (id) => document.getElementById(id);
  const announce = (text) => { one("announce").textContent = text; };
  document.documentElement.classList.remove("no-script");

  // --- what is remembered: {done: {key: true}, answers: {question: option}} -----------------------
  const empty = () => ({ done: {}, answers: {} });
  let memory = empty();
  try {
    const stored = JSON.parse(localStorage.getItem(STORE) || "null");
    if (stored && stored.done && stored.answers) memory = stored;
  } catch (error) { /* storage is off or holds something else: begin afresh */ }
  const remember = () => {
    try { localStorage.setItem(STORE, JSON.stringify(memory)); } catch (error) { /* storage is off */ }
  };

  // --- progress ---------------------------------------------------------------------------------
  const boxes = all("input[data-done]");
  const showProgress = () => {
    const done = boxes.filter((box) => box.checked).length;
    one("progress-text").textContent = `${done} of ${boxes.length} done`;
    one("progress-bar").style.width = `${(100 * done) / boxes.length}%`;
  };
  for (const box of boxes) {
    box.checked = Boolean(memory.done[box.dataset.done]);
    box.addEventListener("change", () => {
      if (box.checked) memory.done[box.dataset.done] = true;
      else delete memory.done[box.dataset.done];
      remember();
      showProgress();
    });
  }
  one("progress-reset").addEventListener("click", () => {
    if (!confirm("Forget every tick and every answer on this page?")) return;
    memory = empty();
    remember();
    for (const input of all("main input")) input.checked = false;
    for (const verdict of all(".verdict")) verdict.textContent = "";
    showProgress();
  });
  all(".progress")[0].hidden = false;
  showProgress();

  // --- questions --------------------------------------------------------------------------------
  const answer = (question, option) => {
    const item = all(`li[data-option="${option}"]`, question)[0];
    if (!item) return;
    const right = item.hasAttribute("data-right");
    const verdict = all(".verdict", question)[0];
    const word = document.createElement("strong");
    word.textContent = right ? "✓ Right. " : "✕ Not quite. ";
    const reason = all(".reason", item)[0].cloneNode(true);
    verdict.replaceChildren(word, reason);
    verdict.classList.toggle("right", right);
  };
  for (const question of all(".question")) {
    for (const radio of all("input", question)) {
      if (memory.answers[radio.name] === radio.value) {
        radio.checked = true;
        answer(question, radio.value);
      }
      radio.addEventListener("change", () => {
        memory.answers[radio.name] = radio.value;
        remember();
        answer(question, radio.value);
      });
    }
  }

  // --- copying: the commands of a block, never prompts and never output ---------------------------
  const copy = async (text) => {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch (error) {
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      const copied = document.execCommand("copy");
      area.remove();
      return copied;
    }
  };
  for (const block of all(".commands")) {
    const commands = all("pre:first-of-type > code", block).map((code) => code.textContent);
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Copy";
    button.setAttribute("aria-label", `Copy: ${commands.join("; ")}`);
    button.addEventListener("click", async () => {
      const copied = await copy(commands.join("\n"));
      button.focus();
      button.textContent = copied ? "Copied" : "Select and copy by hand";
      announce(copied ? "Copied" : "Copying is not allowed here");
      setTimeout(() => { button.textContent = "Copy"; }, 1500);
    });
    all("figcaption", block)[0].append(button);
  }

  // --- troubleshooting: find the row for a pasted error ------------------------------------------
  const field = one("symptom-search");
  if (field) {
    const plain = (text) => text.toLowerCase().replace(/[‘’`´]/g, "'").replace(/[“”]/g, '"').replace(/−/g, "-").replace(/\s+/g, " ");
    const stop = new Set("a an and are at be but by do for from has have i in is it my no not of on or says so still that the there this to under when with you your".split(" "));
    const words = (text) => new Set((plain(text).match(/[a-z0-9_]+/g) || []).filter((word) => !stop.has(word) && (word.length > 1 || /\d/.test(word))));
    const pattern = (piece) => new RegExp(plain(piece).split("*").map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&")).join(".*"));
    const list = one("symptoms");
    const rows = all("article", list).map((element, order) => ({
      element, order,
      pasted: element.dataset.pasted.split("\n").filter(Boolean).map((piece) => [pattern(piece), piece.length]),
      title: words(all("h3", element)[0].textContent + " " + element.dataset.pasted),
      body: words(element.textContent),
    }));
    const score = (row, text, asked) => {
      const found = row.pasted.filter(([piece]) => piece.test(text)).map(([, length]) => length);
      if (found.length) return 1000 + Math.max(...found);
      let points = 0;
      for (const word of asked) points += row.title.has(word) ? 3 : row.body.has(word) ? 1 : 0;
      return points / Math.max(asked.size, 1);
    };
    const search = () => {
      const text = plain(field.value).trim();
      const asked = words(text);
      const scored = rows.map((row) => ({ row, points: text ? score(row, text, asked) : 1 }));
      const best = Math.max(...scored.map(({ points }) => points));
      const least = best >= 1000 ? 1000 : Math.max(0.3, best * 0.6);
      const kept = scored.filter(({ points }) => !text || points >= least);
      if (text) kept.sort((one_, other) => other.points - one_.points || one_.row.order - other.row.order);
      for (const { row } of scored) row.element.hidden = !kept.some((entry) => entry.row === row);
      for (const { row } of kept) list.append(row.element);
      one("symptom-count").textContent = !text ? `${rows.length} rows` : kept.length ? `${kept.length} of ${rows.length} rows fit, best first` : "No row fits. Try fewer words, or ask in the lab.";
    };
    field.addEventListener("input", search);
    one("symptom-clear").addEventListener("click", () => { field.value = ""; search(); field.focus(); });
    all(".search")[0].hidden = false;
    search();
    addEventListener("hashchange", () => {
      if (location.hash.startsWith("#symptom-") && field.value) { field.value = ""; search(); one(location.hash.slice(1))?.scrollIntoView(); }
    });
  }

  // --- contents: where one is; closed on a small screen ------------------------------------------
  const menu = all(".menu")[0];
  if (matchMedia("(max-width: 63.99rem)").matches) menu.open = false;
  const links = new Map(all(".contents a").map((link) => [link.hash.slice(1), link]));
  const headings = all("main h2, main h3").filter((heading) => links.has(heading.id));
  let current = null;
  const where = () => {
    const passed = headings.filter((heading) => heading.getBoundingClientRect().top < innerHeight * 0.3);
    const link = links.get((passed.pop() || headings[0]).id);
    if (link === current) return;
    current?.removeAttribute("aria-current");
    link.setAttribute("aria-current", "location");
    current = link;
  };
  let waiting = false;
  addEventListener("scroll", () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; where(); });
  }, { passive: true });
  where();

  // --- paper: what is folded is opened for printing ----------------------------------------------
  const opened = [];
  addEventListener("beforeprint", () => {
    const folded = all("main details:not([open])");
    for (const details of folded) details.open = true;
    opened.push(...folded);
  });
  addEventListener("afterprint", () => { for (const details of opened.splice(0)) details.open = false; });
})();
