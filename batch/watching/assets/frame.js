// The page around the run of a deck that is watched. It hears what is new, makes the new run ready behind the old one,
// puts it where that was looked at, and lets it take its place. Texts of a deck come in as text nodes alone.
"use strict";

(() => {
  const READY = 400;  // ms, in which a page that nobody sees draws nothing, and is shown as it is
  const make = (tag, about = {}, ...children) => {
    const made = Object.assign(document.createElement(tag), about);
    made.append(...children);
    return made;
  };
  const name = make("code");
  const doing = make("span", { className: "doing" });
  doing.setAttribute("role", "status");
  const runs = make("select", { onchange: () => choose({ run: runs.value }) });
  const groups = make("select", { onchange: () => choose({ run: state.run, group: groups.value }) });
  const [ofRun, ofGroup] = [make("label", {}, "Run ", runs), make("label", {}, "Structure ", groups)];
  const head = make("h2");
  const words = make("pre", { tabIndex: 0 });
  const messages = make("aside", { hidden: true }, head, words);
  const room = make("div", { className: "room" });
  document.body.append(make("header", { className: "deck-bar" }, name, ofRun, ofGroup, doing), make("main", {}, messages, room));

  let state = { page: 0, numbers: 0 };
  let [shown, coming] = [null, null];  // {frame, page, numbers}
  let gone = false;

  async function choose(chosen) {
    await fetch("choose", { method: "POST", body: new URLSearchParams(chosen) });
  }

  function options(select, label, all, chosen) {
    label.hidden = all.length < 2;
    if ([...select.options].map((each) => each.value).join("\n") !== all.join("\n")) select.replaceChildren(...all.map((each) => make("option", { value: each }, each)));
    select.value = chosen;
  }

  const clock = (seconds) => new Date(1000 * seconds).toTimeString().slice(0, 8);
  const ofDeck = /^\s*\d*\s*\|/;  // a line of a file, or the marks under it, which stay one line

  // What `met check` says; told: what was put there last.
  let told = "";
  function say(text) {
    if (told === text) return;
    told = text;
    const parts = [];  // lines of a file that follow one another, which scroll together; and other lines
    text.split("\n").forEach((line) => {
      const last = parts[parts.length - 1];
      if (!ofDeck.test(line)) parts.push(`${line}\n`);
      else if (Array.isArray(last)) last.push(line);
      else parts.push([line]);
    });
    words.replaceChildren(...parts.map((part) => (Array.isArray(part) ? make("span", { className: "of-deck", tabIndex: 0 }, part.join("\n")) : part)));
    reach();
  }

  // The mark under a line comes into sight, also where the line is longer than its place.
  function reach() {
    requestAnimationFrame(() => words.querySelectorAll(".of-deck").forEach((part) => {
      const lines = part.textContent.split("\n");
      const column = Math.max(...lines.map((line) => line.search(/\^/)));
      const longest = Math.max(...lines.map((line) => line.length));
      const mark = (column / longest) * part.scrollWidth;
      if (column >= 0 && mark > 0.8 * part.clientWidth) part.scrollLeft = mark - part.clientWidth / 2;
    }));
  }

  function tell() {
    document.title = `${state.name} · met view`;
    name.textContent = state.name;
    options(runs, ofRun, state.names, state.run);
    options(groups, ofGroup, state.groups, state.group);
    const mistake = state.fault ? "a defect of MET" : "a mistake";
    const broken = state.broken ? `${mistake} since ${clock(state.tried)}` : "";
    const standing = state.page && !state.broken ? `as saved at ${clock(state.saved)}` : "";
    doing.textContent = gone ? "met view has ended: nothing is watched any more" : [broken, state.doing || standing].filter(Boolean).join(" · ");
    doing.classList.toggle("bad", gone || state.broken);
    messages.hidden = !state.messages;
    messages.classList.toggle("bad", state.broken);
    const beside = state.page ? `shown is the run as saved at ${clock(state.saved)}` : "there is no run to show yet";
    head.textContent = state.broken ? `A${mistake.slice(1)}: ${beside}` : "Warnings";
    say(state.messages);
  }

  function take(news) {
    state = news;
    tell();
    if (state.page && state.page !== (coming || shown || {}).page) load(state.page);
    deliver();
  }

  // The new page, behind the one that is seen.
  function load(page) {
    if (coming) coming.frame.remove();
    const frame = make("iframe", { src: `page/${page}`, title: "The run", className: "coming" });
    const mine = { frame, page, numbers: 0 };
    coming = mine;
    frame.addEventListener("load", () => {
      if (coming !== mine) return;
      const { metKept } = frame.contentWindow;
      if (!metKept) return;  // it was gone before it was fetched: another comes
      const standing = () => (shown ? JSON.stringify(shown.frame.contentWindow.metKept.take()) : "");
      const stood = standing();
      if (shown) metKept.put(JSON.parse(stood));
      deliver();
      let done = false;
      const swap = () => {
        if (done || coming !== mine) return;
        done = true;
        if (shown) {
          if (standing() !== stood) metKept.put(JSON.parse(standing()));  // it was moved meanwhile
          if (document.activeElement === shown.frame) frame.contentWindow.focus();
          shown.frame.remove();
        }
        frame.className = "";
        [shown, coming] = [mine, null];
        document.documentElement.dataset.shown = page;
      };
      frame.contentWindow.requestAnimationFrame(() => frame.contentWindow.requestAnimationFrame(swap));
      setTimeout(swap, READY);
    });
    room.append(frame);
  }

  // What came of the cases, to the page that they are of.
  async function deliver() {
    const to = [shown, coming].find((each) => each && each.page === state.page && each.frame.contentWindow.metKept);
    const { numbers } = state;
    if (!to || !numbers || to.numbers === numbers) return;
    to.numbers = numbers;
    const answer = await fetch(`numbers/${numbers}`);
    if (answer.ok && to.frame.isConnected) {
      to.frame.contentWindow.metKept.arrive(await answer.json());
      document.documentElement.dataset.numbers = numbers;
    }
  }

  // A browser opens six connections to a server: so of all its tabs one hears what is new, and tells the others. When that
  // one is closed, another takes its place.
  const mine = location.pathname;
  const others = new BroadcastChannel(mine);
  let [news, hears] = [null, false];
  const heard = (found) => { [news, gone] = [found, false]; take(found); };
  const lost = () => { gone = true; if (state.name) tell(); };

  function hear() {
    hears = true;
    const events = new EventSource("events");
    events.onmessage = (event) => { heard(JSON.parse(event.data)); others.postMessage({ news }); };
    events.onerror = () => { lost(); others.postMessage({ lost: true }); };
  }

  others.onmessage = ({ data }) => {
    if (data.asks && hears && news) others.postMessage(gone ? { lost: true } : { news });
    else if (data.news) heard(data.news);
    else if (data.lost) lost();
  };
  others.postMessage({ asks: true });
  if (navigator.locks) navigator.locks.request(mine, () => new Promise(hear));
  else hear();
})();
