"""A Raspberry Pi in a folder, with the commands that change it."""

from pathlib import Path

from shapechanger.robot.setup.install import Machine, RootCommand


class FakePi:
    """Files of a Raspberry Pi below `root`; without a `config`, it has no config.txt."""

    def __init__(
        self,
        root: Path,
        config: str | None = "camera_auto_detect=1\n",
        groups: tuple[str, ...] = ("dialout", "gpio", "i2c", "video"),
    ) -> None:
        self.root = root
        self.ran: list[str] = []  # The commands so far, as typed.
        self.refuses = ""  # Name of a program whose commands fail.
        self.write("proc/device-tree/model", "Raspberry Pi 4 Model B Rev 1.5\0")
        self.write("etc/group", "".join(f"{name}:x:1:\n" for name in groups))
        self.write("usr/lib/python3/dist-packages/picamera2/__init__.py", "")
        for folder in ("run/systemd", "etc/modules-load.d", "etc/udev/rules.d"):
            (root / folder / "system").mkdir(parents=True)
        (root / "etc/systemd/system/multi-user.target.wants").mkdir(parents=True)
        if config is not None:
            self.write("boot/firmware/config.txt", config)
            self.write("boot/firmware/cmdline.txt", "console=serial0,115200 console=tty1\n")

    @property
    def machine(self) -> Machine:
        return Machine("pi", self.root, self.run)

    @property
    def config(self) -> str:
        return (self.root / "boot/firmware/config.txt").read_text()

    def write(self, name: str, text: str) -> None:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def run(self, command: RootCommand) -> str:
        self.ran.append(str(command))
        if command.arguments[0] == self.refuses:
            return f"{self.refuses}: permission denied"
        wanted = self.root / "etc/systemd/system/multi-user.target.wants"
        match command.arguments:
            case ("tee", "-a", path):
                Path(path).write_text(Path(path).read_text() + command.text)
            case ("tee", path):
                Path(path).write_text(command.text)
            case ("install", "-m", "644", source, path):
                Path(path).write_text(Path(source).read_text())
            case ("rm", "-f", path):
                Path(path).unlink(missing_ok=True)
            case ("usermod", "-aG", group, user):
                lines = (self.root / "etc/group").read_text().splitlines()
                lines = [f"{one}{user}" if one.startswith(f"{group}:") else one for one in lines]
                self.write("etc/group", "\n".join(lines) + "\n")
            case ("systemctl", "enable", unit):
                (wanted / unit).symlink_to(wanted.parent / unit)
            case ("systemctl", "disable", "--now", unit):
                (wanted / unit).unlink(missing_ok=True)
            case ("raspi-config", "nonint", "do_serial_cons", "1"):
                self.write("boot/firmware/cmdline.txt", "console=tty1\n")
            case ("raspi-config", "nonint", name, "0"):
                line = {"do_i2c": "dtparam=i2c_arm=on", "do_serial_hw": "enable_uart=1"}[name]
                self.write("boot/firmware/config.txt", f"{line}\n{self.config}")
            case ("systemctl", "daemon-reload") | ("udevadm", "control", "--reload"):
                pass
            case ("apt-get", "install", "-y", package):
                folder = package.removeprefix("python3-")
                self.write(f"usr/lib/python3/dist-packages/{folder}/__init__.py", "")
            case _:
                raise AssertionError(f"unexpected command: {command}")
        return ""
