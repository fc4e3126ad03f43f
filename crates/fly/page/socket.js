// The connection to the simulation: it comes back by itself.

const FIRST = 200, LONGEST = 2000; // [ms]

export class Socket {
  constructor(hear, connected, refused) {
    this.refused = refused;
    this.hear = hear;
    this.connected = connected;
    this.wait = FIRST;
    this.open();
  }

  open() {
    const token = new URLSearchParams(location.search).get("token") ?? "";
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket?token=${encodeURIComponent(token)}`);
    socket.onopen = () => {
      this.socket = socket;
      this.wait = FIRST;
      this.connected(true);
    };
    socket.onmessage = ({ data }) => this.hear(JSON.parse(data));
    socket.onclose = () => {
      this.socket = null;
      this.connected(false);
      // A program that was started again has another token, and lets this page in no more.
      fetch(location.href, { cache: "no-store" }).then(({ status }) => status === 403 && this.refused(), () => {});
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST);
    };
  }

  say(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
