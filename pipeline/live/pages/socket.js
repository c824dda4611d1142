// A page's WebSocket: JSON both ways, connected again after a break, and the pings by which the server learns this clock.
//
// Who this page is stands in a cookie, so a page that comes back is the same one. Nothing is kept for later here: what was
// not sent while the connection was away is the page's to send again, because only it knows what is still worth sending.

const DELAYS_MS = [250, 500, 1000, 2000];
const FORBIDDEN = 4403;
const REPLACED = 4409; // by this very page in another tab, or loaded anew
const CROWDED = 4429;
const NEVER_OPENED = 4; // tries after which "connecting" turns into advice
const PING_MS = { first: 50, later: 250 };
const FIRST_PINGS_MS = 2000;
const SILENT_MS = 1500; // without a pong: a phone that slept or changed its network may hold a dead connection for minutes
const CLOGGED_BYTES = 8192; // about 50 readings: more would only arrive late

// ms since the epoch of this page's clock; of an event where its time stamp is given.
export function clockMs(timeStamp = performance.now()) {
  return Math.round((performance.timeOrigin + timeStamp) * 1000) / 1000;
}

export class Link {
  // `hello()` gives the first message of each connection; `receive(message)` gets every other one than pongs;
  // `status(name)` hears "connecting", "open", "lost", "unreachable", "forbidden", "replaced" and "crowded".
  constructor(role, { hello, receive, status, pings = false }) {
    Object.assign(this, { role, hello, receive, status, pings });
    this.failures = 0;
    this.everOpen = false;
    this.connect();
  }

  connect() {
    this.status(this.trouble);
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket/${this.role}`);
    this.socket = socket;
    socket.onopen = () => this.opened();
    socket.onmessage = (event) => this.received(event.data);
    socket.onclose = (event) => this.closed(event.code);
  }

  get trouble() {
    if (this.everOpen) return "lost";
    return this.failures < NEVER_OPENED ? "connecting" : "unreachable";
  }

  opened() {
    this.everOpen = true;
    this.openedAt = this.heardAt = performance.now();
    this.send(this.hello());
    this.status("open");
    if (this.pings) this.ping();
  }

  received(text) {
    this.failures = 0; // not at opening: a server that closes at once is not to be asked four times a second
    const arrived = clockMs();
    this.heardAt = performance.now();
    const message = JSON.parse(text);
    if (message.type !== "pong") this.receive(message);
    else this.answered = { t1: message.t1, t2: message.t2, t3: message.t3, t4: arrived };
  }

  closed(code) {
    clearTimeout(this.nextPing);
    if (code === FORBIDDEN || code === REPLACED) {
      this.status(code === FORBIDDEN ? "forbidden" : "replaced");
      return;
    }
    const delay = DELAYS_MS[Math.min(this.failures, DELAYS_MS.length - 1)];
    this.failures += 1;
    this.status(code === CROWDED ? "crowded" : this.trouble);
    setTimeout(() => this.connect(), delay);
  }

  // Each ping also brings the four times of the last answered one: the server cannot know when its pong arrived.
  ping() {
    if (performance.now() - this.heardAt > SILENT_MS) {
      this.abandon();
      return;
    }
    this.send({ type: "ping", t1: clockMs(), ...(this.answered && { last: this.answered }) });
    this.answered = undefined;
    const wait = performance.now() - this.openedAt < FIRST_PINGS_MS ? PING_MS.first : PING_MS.later;
    this.nextPing = setTimeout(() => this.ping(), wait);
  }

  // Not waiting for the other end to agree to closing, which a dead connection never does.
  abandon() {
    const { socket } = this;
    Object.assign(socket, { onopen: null, onmessage: null, onclose: null });
    socket.close();
    this.closed();
  }

  get open() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  // Whether it went on its way.
  send(message) {
    if (!this.open) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  // A reading is only worth sending while it is fresh; what is left out shows as a gap in `seq`.
  sendReading(message) {
    if (this.open && this.socket.bufferedAmount < CLOGGED_BYTES) this.send(message);
  }
}
